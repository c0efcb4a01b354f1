"""Independent ensembles of emcee walkers with a frozen proposal, and how they are warmed up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from bayeshaptic.inference.sampling.near_zero import Redraw
from bayeshaptic.numerics.mixture import StudentMixture, student
from bayeshaptic.numerics.mixture_fit import fit_student_mixture
from bayeshaptic.numerics.straightening import Straightening, nothing_to_straighten, straighten
from bayeshaptic.types import Floats, LogDensity

Move = Callable[[Floats, np.random.RandomState], tuple[Floats, Floats]]
"""From walkers (W, P) to proposed ones, with log density of proposing the way back over there."""
ENSEMBLES = 4
WALKERS = 64
_WARM_UP = (2, 2, 4, 4, 6, 6, 6, 6)  # steps a parameter in each round
_IDLE = 2  # rounds without a gain
# Of the moves that are independent proposals; the others are differences, which help where the
# proposal misses something and gain little elsewhere.
_WARM, _FROZEN = 0.6, 0.95
_MISSED = 2.0  # log of density over proposal, above the median, from which a place is missed
# Degrees of freedom of what a proposal is made of, next to normal as posteriors are, and of what
# covers its tails.  In eleven dimensions five throughout cost a third of what is accepted.
_FREEDOM, _SAFE = 30.0, 5.0
_ARCHIVE = 4000  # places between which differences are taken


@dataclass(frozen=True)
class Proposal:
    """What walkers propose, in straight coordinates; walkers share it, and nothing else.

    Attributes
    ----------
    straightening : Straightening
    mixture : StudentMixture
        Of independent proposals.
    archive : ndarray, shape (n, P)
        Points whose differences are steps.
    """

    straightening: Straightening
    mixture: StudentMixture
    archive: Floats = field(repr=False)

    def independent(self, walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
        """A draw from the mixture for each walker."""
        drawn = self.mixture.sample(_generator(rng), len(walkers))
        here, there = np.split(self.mixture.log_density(np.concatenate([walkers, drawn])), 2)
        return drawn, here - there

    def differences(self, walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
        """A step by the difference of two points of the archive for each walker.

        Differential evolution from the past (C. J. F. ter Braak and J. A. Vrugt, Statistics and
        Computing 18, 2008), with an archive that does not change: all walkers move at once, and
        each is a chain of its own.
        """
        generator, (count, size) = _generator(rng), walkers.shape
        ends = self.archive[generator.integers(len(self.archive), size=(2, count))]
        leaps = 0.1  # of the differences that are taken whole: from one hump to another
        length = np.where(generator.uniform(size=count) < leaps, 1.0, 2.38 / np.sqrt(2 * size))
        step = length[:, None] * (ends[0] - ends[1])
        jitter = 1e-5
        step += jitter * generator.standard_normal(walkers.shape)
        return walkers + step, np.zeros(count)


@dataclass
class Ensembles:
    """Four ensembles of 64 walkers, advanced together: one call of the density moves them all.

    They begin apart, each at draws of its own, and never see each other.

    Attributes
    ----------
    density : callable
        Log density of points of shape (B, P).
    proposal : Proposal
    share : float
        Of the moves that are independent proposals; the others are differences.
    positions : ndarray, shape (ensembles * walkers, P)
    state : tuple
        State of a `numpy.random.RandomState`: emcee would copy the global one.
    redraw : callable, optional
        A proposal of a few coordinates alone, for a fifth of the moves.
    """

    density: LogDensity
    proposal: Proposal
    share: float
    positions: Floats
    state: Any
    redraw: Redraw | None = None
    sampler: Any = field(init=False)

    def __post_init__(self) -> None:
        import emcee

        straightening, size = self.proposal.straightening, self.positions.shape[1]
        moves: list[tuple[Move, float]] = [
            (self.proposal.independent, self.share),
            (self.proposal.differences, 1 - self.share),
        ]
        redraw = self.redraw
        if redraw is not None:

            def alone(walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
                drawn, factor = redraw(straightening.bent(walkers), _generator(rng))
                return straightening.straight(drawn), factor

            redrawn = 0.15  # of redrawing moves, for each of the others
            moves.append((alone, redrawn))

        class Sampler(emcee.EnsembleSampler):  # type: ignore[misc]
            """Without emcee's conversion of each walker's number, a tenth of a step."""

            def compute_log_prob(self, coords: Floats) -> tuple[Floats, None]:
                return self.log_prob_fn(coords), None

        self.sampler = Sampler(
            len(self.positions),
            size,
            lambda y: self.density(straightening.bent(y)),
            moves=[(emcee.moves.MHMove(move, ndim=size), share) for move, share in moves],
            vectorize=True,
        )
        self.sampler.random_state = self.state

    def advance(self, steps: int, every: int = 1) -> tuple[Floats, Floats]:
        """Go on until `steps` more are kept, `every` so many one.

        Returns
        -------
        positions : ndarray, shape (ensembles, steps, walkers, P)
        log_density : ndarray, shape (ensembles, steps, walkers)
        """
        self.sampler.reset()
        straightening = self.proposal.straightening
        start = straightening.straight(self.positions)
        # The walkers are checked for independence at the start only; later they may well meet.
        last = self.sampler.run_mcmc(start, steps, skip_initial_state_check=True, thin_by=every)
        self.positions, self.state = straightening.bent(last.coords), self.sampler.random_state
        chain = self.sampler.get_chain()
        bent = straightening.bent(chain.reshape(-1, chain.shape[2])).reshape(chain.shape)
        return _by_ensemble(bent), _by_ensemble(self.sampler.get_log_prob())


def warmed_up(
    density: LogDensity,
    first: StudentMixture,
    seed: np.random.SeedSequence,
    peak: Floats,
    redraw: Redraw | None = None,
) -> Ensembles:
    """Ensembles that have forgotten their starts, with one proposal, refitted and frozen.

    Each begins at its own draws of a `first` proposal, so that R-hat between them can see a second
    mode; where these miss the support, near `peak`.  After each round of warm-up the proposal is
    fitted to where the walkers have been.  Rounds follow while the walkers accept the new one too
    rarely, until neither that nor their density improves any more.
    """
    *seeds, last = seed.spawn(ENSEMBLES + 1)
    rng = np.random.default_rng(last)
    size = len(peak)
    starts = [_spread_start(density, first, peak, np.random.default_rng(own)) for own in seeds]
    proposal = Proposal(nothing_to_straighten(size), first, first.sample(rng, _ARCHIVE))
    state = np.random.RandomState(np.random.MT19937(last)).get_state()
    ensembles = Ensembles(density, proposal, _WARM, np.concatenate(starts), state, redraw)
    best, level, idle = 0.0, -np.inf, 0
    fewest = 8  # steps that a proposal is fitted to
    good = 0.5  # acceptance of independent proposals from which another round gains nothing
    climb = 0.1  # rise of the mean log density, in its standard deviations, that is no accident
    for share in _WARM_UP:
        steps = max(share * size, 2 * fewest)
        chains, log_density = ensembles.advance(steps)
        late = slice(steps // 2, None, max(steps // 24, 1))
        found, values = chains[:, late].reshape(-1, size), log_density[:, late].ravel()
        ensembles = _with(ensembles, _fitted(found, values, rng))
        acceptance = _acceptance(density, ensembles.proposal, found, values, rng)
        climbing = values.mean() - level > climb * values.std()
        idle = 0 if acceptance > 1.1 * best or climbing else idle + 1
        if acceptance > good or idle == _IDLE:
            break
        best, level = max(best, acceptance), max(level, values.mean())
    # Tails that the first proposal misses were not reached yet: of a damper that may be zero the
    # 95 % point of K_CR lay half a standard deviation low in the four steps that followed.
    settling = 8
    ensembles.advance(settling)
    return ensembles


def refitted(
    ensembles: Ensembles, chains: Floats, values: Floats, rng: np.random.Generator
) -> Ensembles:
    """The ensembles where they are, with a proposal fitted to their `chains` (E, S, W, P).

    `values` are the log densities there, (E, S, W).
    """
    found = chains.reshape(-1, chains.shape[-1])
    most_points = 20_000  # that a proposal is fitted to
    every = max(2, -(-len(found) // most_points))
    return _with(ensembles, _fitted(found[::every], values.ravel()[::every], rng))


def _with(ensembles: Ensembles, proposal: Proposal) -> Ensembles:
    return replace(ensembles, proposal=proposal, share=_FROZEN)


def _by_ensemble(chain: Floats) -> Floats:
    """(steps, ensembles * walkers, ...) to (ensembles, steps, walkers, ...)."""
    split = chain.reshape(len(chain), ENSEMBLES, -1, *chain.shape[2:])
    return np.swapaxes(split, 0, 1)


def _generator(rng: np.random.RandomState) -> np.random.Generator:
    return np.random.default_rng(rng.randint(2**31))


def _fitted(found: Floats, values: Floats, rng: np.random.Generator) -> Proposal:
    """A proposal for a density from which `found` are draws, with log densities `values`.

    A walker stays for long where the proposal misses the density: such places get a share of their
    own.
    """
    straightening = straighten(found)
    y = straightening.straight(found)
    _, once = np.unique(values, return_index=True)  # a walker that stays is found many times
    size = y.shape[1]
    numbers = 1 + size + size * (size + 1) // 2  # of a component
    points_a_number = 12  # fewer, and components follow the accidents of the draws
    most_components = 6
    components = int(np.clip(len(once) / (points_a_number * numbers), 1, most_components))
    mixture = fit_student_mixture(y, np.ones(len(y)), components, _FREEDOM, rng)
    wide = student(y.mean(axis=0), 1.5 * np.cov(y.T), _SAFE)
    mixture = mixture.with_component(wide, 0.1)
    tails = 3
    for _ in range(tails):
        excess = values[once] - mixture.log_density(y[once])
        missed = y[once][excess > np.median(excess) + _MISSED]
        if len(missed) <= 4 * y.shape[1]:
            break
        there = student(missed.mean(axis=0), 1.2 * np.cov(missed.T), _SAFE)
        mixture = mixture.with_component(there, 0.08)
    return Proposal(straightening, mixture, y[rng.choice(len(y), _ARCHIVE)])


def _acceptance(
    density: LogDensity,
    proposal: Proposal,
    found: Floats,
    values: Floats,
    rng: np.random.Generator,
) -> float:
    """How often proposals are accepted, by walkers at `found` and between draws of the proposal.

    The walkers, whose log densities are `values`, tell where the proposal misses the density; its
    own draws, weighted, whether the walkers have spread over humps as the density does.
    """
    tried = 1000
    here = rng.choice(len(found), tried)
    drawn = proposal.mixture.sample(rng, tried)
    there = density(proposal.straightening.bent(drawn)) - proposal.mixture.log_density(drawn)
    straight = proposal.straightening.straight(found[here])
    gain = there - (values[here] - proposal.mixture.log_density(straight))
    weights = np.sort(np.exp(there - np.max(there, initial=-np.finfo(float).max)))[::-1]
    lesser = weights @ (2 * np.arange(tried) + 1) / tried  # of all pairs, the lesser weight
    between = lesser / max(weights.sum(), np.finfo(float).tiny)
    return min(float(np.mean(np.exp(np.minimum(gain, 0.0)))), float(between))


def _spread_start(
    density: LogDensity, first: StudentMixture, peak: Floats, rng: np.random.Generator
) -> Floats:
    """Walkers where the density is positive: from the proposal, which is wider than the target.

    Where the proposal all but misses the support, nearer and nearer to the peak.
    """
    start = np.empty((0, len(peak)))
    for attempt in range(200):
        shrink = 0.8 ** max(attempt - 20, 0)
        drawn = peak + shrink * (first.sample(rng, 4 * WALKERS) - peak)
        start = np.concatenate([start, drawn[np.isfinite(density(drawn))]])
        if len(start) >= WALKERS:
            break
    # Where none is found the sampler says that it has not converged.
    alike = np.broadcast_to(peak, (max(WALKERS - len(start), 0), len(peak)))
    return np.concatenate([start[:WALKERS], alike])
