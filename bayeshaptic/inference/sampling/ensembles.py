"""Independent emcee ensembles with a frozen proposal, and how they are warmed up."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bayeshaptic.inference.sampling.importance import Adapted
from bayeshaptic.inference.sampling.near_zero import Redraw
from bayeshaptic.numerics.mixture import StudentMixture, fit_student_mixture, student
from bayeshaptic.numerics.straightening import Straightening, nothing_to_straighten, straighten
from bayeshaptic.types import Floats

LogDensity = Callable[[Floats], Floats]
_REDRAWN = 0.25  # of such moves, for each of the others
ENSEMBLES = 4
WALKERS = 64
_WARM_UP = 80
_ROUNDS = 12  # of warm-up, at most
_GOOD = 0.4  # acceptance of independent proposals from which another round gains nothing
_CLIMB = 0.1  # rise of the mean log density, in its standard deviations, that is no accident
_MOST_POINTS = 20_000  # that a proposal is fitted to
_POINTS_A_COMPONENT = 2000
_MOST_COMPONENTS = 6  # more follow the accidents of the draws
_MISSED = 2.0  # log of density over proposal, above the median, from which a place is missed
_TAILS = 3
_TRIED = 1000


@dataclass(frozen=True)
class Proposal:
    """Independent proposals: a mixture in straight coordinates."""

    straightening: Straightening
    mixture: StudentMixture


@dataclass
class Ensemble:
    """One emcee ensemble with its own random state; it runs in straight coordinates.

    emcee copies the global random state into every sampler: without a state of its own,
    "independent" ensembles would be identical.

    Attributes
    ----------
    density : callable
        Log density of points of shape (B, P).
    proposal : Proposal
    share : float
        Of the moves that are independent proposals; the others are differential evolution.
    positions : ndarray, shape (walkers, P)
    state : tuple
        State of a `numpy.random.RandomState`.
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

        straightening, mixture = self.proposal.straightening, self.proposal.mixture

        def independence(coords: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
            generator = np.random.default_rng(rng.randint(2**31))
            drawn = mixture.sample(generator, len(coords))
            return drawn, mixture.log_density(coords) - mixture.log_density(drawn)

        size = self.positions.shape[1]
        moves = [
            (emcee.moves.MHMove(independence, ndim=size), self.share),
            (emcee.moves.DEMove(), 1 - self.share),
        ]
        redraw = self.redraw
        if redraw is not None:

            def alone(coords: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
                generator = np.random.default_rng(rng.randint(2**31))
                drawn, factor = redraw(straightening.bent(coords), generator)
                return straightening.straight(drawn), factor

            moves.append((emcee.moves.MHMove(alone, ndim=size), _REDRAWN))
        self.sampler = emcee.EnsembleSampler(
            len(self.positions),
            size,
            lambda y: self.density(straightening.bent(y)),
            moves=moves,
            vectorize=True,
        )
        self.sampler.random_state = self.state

    def advance(self, steps: int) -> tuple[Floats, Floats]:
        """Go on by `steps`: positions (steps, walkers, P) and log densities (steps, walkers)."""
        self.sampler.reset()
        straightening = self.proposal.straightening
        start = straightening.straight(self.positions)
        # The walkers are checked for independence at the start only; later they may well meet.
        last = self.sampler.run_mcmc(start, steps, skip_initial_state_check=True)
        self.positions, self.state = straightening.bent(last.coords), self.sampler.random_state
        chain = self.sampler.get_chain()
        bent = straightening.bent(chain.reshape(-1, chain.shape[2]))
        return bent.reshape(chain.shape), self.sampler.get_log_prob()


def warmed_up(
    density: LogDensity,
    adapted: Adapted,
    seed: np.random.SeedSequence,
    peak: Floats | None = None,
    redraw: Redraw | None = None,
) -> list[Ensemble]:
    """Ensembles that have forgotten their starts, with one proposal, refitted and frozen.

    Each begins at its own widened draws, so that R-hat between them can see a second mode; where
    these miss the support, near `peak` (by default the heaviest point).  After
    each round of warm-up the proposal is fitted to where the walkers have been.  Rounds follow
    while the walkers, out of the sample that the proposal was fitted to, accept it too rarely,
    and that or their density still improves.
    """
    seeds = seed.spawn(ENSEMBLES + 1)
    rng = np.random.default_rng(seeds[-1])
    size = adapted.points.shape[1]
    if peak is None:
        peak = adapted.points[int(np.argmax(adapted.weights))]
    proposal = Proposal(nothing_to_straighten(size), adapted.proposal)
    ensembles = []
    for own in seeds[:ENSEMBLES]:
        start = _spread_start(density, adapted, peak, np.random.default_rng(own))
        ensembles.append(Ensemble(density, proposal, 0.6, start, _state(own), redraw))
    before, level = 0.0, -np.inf
    for _ in range(_ROUNDS):
        runs = [ensemble.advance(_WARM_UP) for ensemble in ensembles]
        found = np.concatenate([chain[_WARM_UP // 2 :: 2].reshape(-1, size) for chain, _ in runs])
        values = np.concatenate([value[_WARM_UP // 2 :: 2].ravel() for _, value in runs])
        acceptance = _acceptance(density, proposal, found, values, rng)
        proposal = _fitted(found, values, rng)
        ensembles = [_with(e, proposal) for e in ensembles]
        climbing = values.mean() - level > _CLIMB * values.std()
        if acceptance > _GOOD or not (acceptance > 1.1 * before or climbing):
            break
        before, level = acceptance, values.mean()
    return ensembles


def refitted(
    ensembles: list[Ensemble], chains: Floats, values: Floats, rng: np.random.Generator
) -> list[Ensemble]:
    """The ensembles where they are, with a proposal fitted to their `chains` (E, S, W, P).

    `values` are the log densities there, (E, S, W).
    """
    found = chains.reshape(-1, chains.shape[-1])
    every = max(4, -(-len(found) // _MOST_POINTS))
    proposal = _fitted(found[::every], values.ravel()[::every], rng)
    return [_with(ensemble, proposal) for ensemble in ensembles]


def _with(ensemble: Ensemble, proposal: Proposal) -> Ensemble:
    return Ensemble(
        ensemble.density, proposal, 0.75, ensemble.positions, ensemble.state, ensemble.redraw
    )


def _fitted(found: Floats, values: Floats, rng: np.random.Generator) -> Proposal:
    """A proposal for a density from which `found` are draws, with log densities `values`.

    A walker stays for long where the proposal misses the density: such places get a share of their
    own.
    """
    straightening = straighten(found)
    y = straightening.straight(found)
    components = int(np.clip(len(y) // _POINTS_A_COMPONENT, 3, _MOST_COMPONENTS))
    mixture = fit_student_mixture(y, np.ones(len(y)), components, 10.0, rng)
    wide = student(y.mean(axis=0), 1.5 * np.cov(y.T), 5.0)
    mixture = mixture.with_component(wide, 0.1)
    _, once = np.unique(values, return_index=True)  # a walker that stays is found many times
    for _ in range(_TAILS):
        excess = values[once] - mixture.log_density(y[once])
        missed = y[once][excess > np.median(excess) + _MISSED]
        if len(missed) <= 4 * y.shape[1]:
            break
        there = student(missed.mean(axis=0), 1.2 * np.cov(missed.T), 5.0)
        mixture = mixture.with_component(there, 0.08)
    return Proposal(straightening, mixture)


def _acceptance(
    density: LogDensity,
    proposal: Proposal,
    found: Floats,
    values: Floats,
    rng: np.random.Generator,
) -> float:
    """How often walkers at `found`, whose log densities are `values`, would accept a proposal."""
    here = rng.choice(len(found), _TRIED)
    drawn = proposal.mixture.sample(rng, _TRIED)
    there = density(proposal.straightening.bent(drawn)) - proposal.mixture.log_density(drawn)
    straight = proposal.straightening.straight(found[here])
    gain = there - (values[here] - proposal.mixture.log_density(straight))
    return float(np.mean(np.exp(np.minimum(gain, 0.0))))


def _spread_start(
    density: LogDensity, adapted: Adapted, peak: Floats, rng: np.random.Generator
) -> Floats:
    """Walkers where the density is positive: from the proposal, which is wider than the target.

    Where the proposal all but misses the support, nearer and nearer to the peak.
    """
    start = np.empty((0, len(peak)))
    for attempt in range(200):
        shrink = 0.8 ** max(attempt - 20, 0)
        drawn = peak + shrink * (adapted.proposal.sample(rng, 4 * WALKERS) - peak)
        start = np.concatenate([start, drawn[np.isfinite(density(drawn))]])
        if len(start) >= WALKERS:
            break
    return start[:WALKERS]


def _state(seed: np.random.SeedSequence) -> Any:
    return np.random.RandomState(np.random.MT19937(seed)).get_state()
