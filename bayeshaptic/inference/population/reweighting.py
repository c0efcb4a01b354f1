"""Every recording's parameters given the whole study, by its exact likelihood.

Three ways, the cheapest first; all of them lead to the same distribution, the recording's exact
likelihood times what the others say (`cavity.py`):

- draws of the levels, weighed by exact over described likelihood: where the study knows more than
  the recording does, and the description is good;
- the recording's own draws, weighed by what the others say over the recording's own prior, as in
  Hogg, Myers and Bovy (2010): where the recording knows more than the study does;
- sampling with what the others say as the prior: a Student t mixture is fitted by emcee ensembles,
  and its draws are weighed, or, where that is poor, the ensembles go on as for one recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.population.below import Below, draw_below
from bayeshaptic.inference.population.cavity import Cavity, cavity
from bayeshaptic.inference.population.gaussian_likelihood import described, exact_likelihood
from bayeshaptic.inference.population.hierarchy import Hierarchy
from bayeshaptic.inference.population.sampler import TOLERABLE, run_ensembles
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampling.ensembles import warmed_up
from bayeshaptic.numerics.mixture import student
from bayeshaptic.numerics.pareto import pareto_k
from bayeshaptic.numerics.weights import effective, normalised, tempered
from bayeshaptic.types import Floats

POOR_K = 0.7  # Pareto k from which importance weights are not to be trusted
_FEW = 1000  # effective draws that are too few
_HARMLESS = 0.5  # share of effective draws from which a heavy tail is harmless
_ENOUGH, _MOST = 21_000, 22_000  # draws, for risks down to 0.1 %
DESCRIBED, OWN, SAMPLED, ALONE = "described", "own", "sampled", "alone"


@dataclass(frozen=True)
class Reweighted:
    """One recording's parameters given all recordings of the study.

    Attributes
    ----------
    user : str
    draws : ndarray, shape (n, P)
        Natural values, equally weighted.
    effective : float
        Kish's effective number of the weighted draws that these were chosen from; of chains their
        least effective number.
    pareto_k : float
        Shape of the tail of the weights: above 0.7 they are not to be trusted; nan without weights.
    how : {"described", "own", "sampled", "alone"}
        Draws of the levels weighed, the recording's own weighed, sampled; or the recording by
        itself, where none of these came out.
    share : float
        Effective number over that of the draws that were weighed.
    """

    user: str
    draws: Floats = field(repr=False)
    effective: float
    pareto_k: float
    how: str = DESCRIBED
    share: float = 1.0

    @property
    def good(self) -> bool:
        """Whether there are enough effective draws, with weights that can be trusted."""
        if self.how == ALONE:
            return False
        light = not self.pareto_k > POOR_K or self.share > _HARMLESS
        return light and (self.effective >= _FEW or self.share > _HARMLESS)


def reweight(
    posteriors: Sequence[Posterior],
    users: Sequence[str],
    hierarchy: Hierarchy,
    below: Below,
    phi: Floats,
    here: Coordinates,
    seed: np.random.SeedSequence,
) -> tuple[Reweighted, ...]:
    """Draws of every recording given the study, in the order of the recordings.

    Parameters
    ----------
    posteriors : sequence of Posterior
    users : sequence of str
        One a recording.
    hierarchy : Hierarchy
    below : Below
        Draws of what lies below the hyperparameters `phi`, shape (n, Q).
    here : Coordinates
    seed : numpy.random.SeedSequence
    """
    count, found = len(below.recordings), []
    for r, own in enumerate(seed.spawn(len(users))):
        wanted = Wanted(posteriors[r], users[r], here, count, np.random.default_rng(own))
        found.append(_by_the_cheapest(wanted, r, hierarchy, below, phi, own))
    return tuple(found)


def redescribed(
    hierarchy: Hierarchy,
    posteriors: Sequence[Posterior],
    users: Sequence[str],
    phi: Floats,
    here: Coordinates,
    spike: Floats,
    seed: np.random.SeedSequence,
) -> Hierarchy:
    """The levels with a better description of each likelihood whose first one is poor.

    That is fitted to the likelihood over draws of the recording's exact distribution given all
    others (`gaussian_likelihood.described`): near a wall, or on a ridge that is bent, the model is
    not linear over the width of what is known.  The likelihood goes on beyond a wall, and so does
    its description: the wall is the device's, and counts once.
    """
    first, last = seed.spawn(2)
    below = draw_below(hierarchy, phi, here.low, np.random.default_rng(first), spike)
    here = replace(here, low=np.full(len(here.low), -np.inf))
    found, changed = list(hierarchy.likelihoods), False
    for r, own in enumerate(reweight(posteriors, users, hierarchy, below, phi, here, last)):
        if own.how not in (OWN, SAMPLED):
            continue
        better = described(posteriors[r], here, own.draws)
        if better is not None:
            found[r], changed = better, True
    return replace(hierarchy, likelihoods=tuple(found)) if changed else hierarchy


@dataclass(frozen=True)
class Wanted:
    """A recording, and what of it is wanted.

    Attributes
    ----------
    posterior : Posterior
        Of the recording by itself.
    user : str
    here : Coordinates
        Of the study.
    count : int
        Draws that are wanted.
    rng : numpy.random.Generator
    """

    posterior: Posterior
    user: str
    here: Coordinates
    count: int
    rng: np.random.Generator

    def own(self, most: int) -> Floats:
        """No more than so many of the recording's own draws, shape (n, D)."""
        every = -(-len(self.posterior.draws) // most)
        return self.here.coordinate(self.posterior.draws[::every])

    def own_weight(self, rest: Cavity, x: Floats) -> Floats:
        """Of the recording's own draws: log density of the cavity over that of its own prior."""
        prior = self.posterior.model.log_prior(self.here.natural(x)) + self.here.log_jacobian(x)
        return np.asarray(rest(x) - prior, float)

    @property
    def cut_off(self) -> bool:
        """Whether its own draws end at a wall beyond which `here` goes on."""
        x, here, model = self.own(_FEW), self.here, self.posterior.model
        end = here.coordinate(np.array([model.prior(name).support[0] for name in model.names]))
        leans = 3.0  # standard deviations
        return bool(np.any((end > here.lowest) & (x.mean(axis=0) - end < leans * x.std(axis=0))))

    def resampled(self, x: Floats, log_weight: Floats, how: str) -> Reweighted:
        """Each of `x` as often as its weight says (systematic resampling)."""
        weight = normalised(log_weight)
        number = effective(weight)
        # No more than there are to choose from: what comes again and again would count as many.
        count = int(np.ceil(min(self.count, number, _MOST)))
        steps = (np.arange(count) + self.rng.uniform()) / count
        chosen = np.minimum(np.searchsorted(np.cumsum(weight), steps), len(x) - 1)
        draws = self.here.natural(x[self.rng.permutation(chosen)])
        k = pareto_k(log_weight[np.isfinite(log_weight)])
        return Reweighted(self.user, draws, number, k, how, number / len(x))

    def enough(self, found: Reweighted) -> bool:
        """Whether nothing better is worth looking for: 20 draws below 0.1 % risk are enough.

        Half as many of the levels' own draws: they alone know of dampers that the device lacks,
        and of more than some hundred draws of the hyperparameters.
        """
        least = _ENOUGH if self.count > _ENOUGH and found.how != DESCRIBED else 0.0
        return found.good and found.effective >= max(least, _HARMLESS * min(self.count, _ENOUGH))

    def alone(self) -> Reweighted:
        """The recording by itself."""
        draws = self.posterior.draws[:: -(-len(self.posterior.draws) // self.count)]
        return Reweighted(self.user, draws, float(self.posterior.effective), float("nan"), ALONE)


def _by_the_cheapest(
    wanted: Wanted,
    r: int,
    hierarchy: Hierarchy,
    below: Below,
    phi: Floats,
    seed: np.random.SeedSequence,
) -> Reweighted:
    """Recording `r` by the cheapest way that is good enough, else by the best of all three."""
    first = from_levels(wanted, below.recordings[:, r], hierarchy.likelihoods[r])
    if wanted.posterior.windows is None or (first is not None and wanted.enough(first)):
        return first or wanted.alone()
    rest = cavity(hierarchy, r, phi, wanted.rng)
    second = None if wanted.cut_off else from_own(wanted, rest)
    if second is not None and wanted.enough(second):
        return second
    third = sampled(wanted, rest, seed.spawn(1)[0])
    good = [one for one in (first, second, third) if one is not None and one.good]
    return max(good, key=lambda one: one.effective, default=wanted.alone())


def from_levels(
    wanted: Wanted, x: Floats, description: Callable[[Floats], Floats]
) -> Reweighted | None:
    """Draws of the levels inside the walls, weighed by exact over described likelihood."""
    x = x[np.all(x >= wanted.here.lowest, axis=1)]
    exact = exact_likelihood(wanted.posterior, wanted.here, x) if len(x) else None
    if wanted.posterior.windows is not None and (exact is None or not np.isfinite(exact).any()):
        return None
    log_weight = np.zeros(len(x)) if exact is None else exact - description(x)
    return wanted.resampled(x, log_weight, DESCRIBED)


def from_own(wanted: Wanted, rest: Cavity) -> Reweighted:
    """The recording's own draws, weighed by the cavity over its own prior."""
    most_own = 40_000
    x = wanted.own(most_own)
    return wanted.resampled(x, wanted.own_weight(rest, x), OWN)


def sampled(wanted: Wanted, rest: Cavity, seed: np.random.SeedSequence) -> Reweighted | None:
    """Draws from exact likelihood times cavity; None where the sampler does not converge."""
    low, rng = wanted.here.lowest, wanted.rng

    def density(x: Floats) -> Floats:
        value = np.full(len(x), -np.inf)
        inside = np.all((x >= low) & (np.abs(x) < 600), axis=1)
        if inside.any():
            exact = exact_likelihood(wanted.posterior, wanted.here, x[inside])
            assert exact is not None
            value[inside] = exact + rest(x[inside])
        return value

    start = 3000
    x = wanted.own(start)
    weight = tempered(wanted.own_weight(rest, x), 0.05 * len(x))
    mean = weight @ x
    off = x - mean
    first = student(mean, (weight[:, None] * off).T @ off, 8.0)
    ensembles = warmed_up(density, first, seed, x[int(np.argmax(density(x)))])
    proposal = ensembles.proposal
    proposed = 2.0  # draws of a proposal for each that is wanted
    y = proposal.mixture.sample(rng, int(proposed * wanted.count))
    x = proposal.straightening.bent(y)
    found = wanted.resampled(x, density(x) - proposal.mixture.log_density(y), SAMPLED)
    if found.good:
        return found
    enough = 2000.0  # effective draws to sample
    chains = run_ensembles(ensembles, np.random.default_rng(seed.spawn(1)[0]), enough)
    ess = chains.diagnostics.ess
    if chains.diagnostics.rhat.max() > TOLERABLE or ess < _FEW:
        return None
    draws = wanted.here.natural(chains.thinned(min(wanted.count, int(ess)), rng))
    return Reweighted(wanted.user, draws, ess, float("nan"), SAMPLED)


def inside(x: Floats, here: Coordinates) -> Floats:
    """Points `x`, shape (n, D), mirrored at the walls, so that no damper is negative."""
    low = here.lowest
    with np.errstate(invalid="ignore"):
        return np.where(x < low, 2 * low - x, x)
