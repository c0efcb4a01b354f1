"""Independent ensembles of emcee walkers with a frozen proposal, and how they are warmed up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

import numpy as np

from bayeshaptic.inference.sampling.near_zero import Redraw
from bayeshaptic.inference.sampling.proposal import Proposal, acceptance, fitted, generator_of
from bayeshaptic.inference.sampling.several_peaks import SeveralPeaks, shares_of
from bayeshaptic.numerics.mixture import StudentMixture
from bayeshaptic.types import Floats, LogDensity

Move = Callable[[Floats, np.random.RandomState], tuple[Floats, Floats]]
"""From walkers (W, P) to proposed ones, with log density of proposing the way back over there."""
ENSEMBLES = 4
WALKERS = 64
_WARM_UP = (2, 2, 4, 4, 6, 6, 6, 6)  # steps a parameter in each round
_IDLE = 2  # rounds without a gain
# Share of moves that are independent proposals, in the warm-up and after it; the others are
# differences, which help where the proposal misses something and gain little elsewhere.
_WARM, _FROZEN = 0.6, 0.95
_TOGETHER = 0.8  # the same over several peaks, where proposals miss more


P = TypeVar("P", Proposal, SeveralPeaks)


@dataclass
class Ensembles(Generic[P]):
    """Four ensembles of 64 walkers, advanced together: one call of the density moves them all.

    They begin apart, each at draws of its own, and never see each other.

    Attributes
    ----------
    density : callable
        Log density of points of shape (B, P).
    proposal : Proposal or SeveralPeaks
    share : float
        Of the moves that are independent proposals; the others are differences.
    positions : ndarray, shape (ensembles * walkers, P)
    state : tuple
        State of a `numpy.random.RandomState`: emcee would copy the global one.
    redraw : callable, optional
        A proposal of a few coordinates alone, for an eighth of the moves.
    """

    density: LogDensity
    proposal: P
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
                drawn, factor = redraw(straightening.bent(walkers), generator_of(rng))
                return straightening.straight(drawn), factor

            redrawn = 0.15  # of redrawing moves, for each of the others
            moves.append((alone, redrawn))

        def density(y: Floats) -> Floats:
            return self.density(straightening.bent(y))

        class Sampler(emcee.EnsembleSampler):  # type: ignore[misc]
            """Without emcee's conversion of each walker's number, a tenth of a step.

            And without its copy of the generator's state in every step, a twentieth; nor does it
            print all walkers where it is stopped.
            """

            random_state = None

            def compute_log_prob(self, coords: Floats) -> tuple[Floats, None]:
                return density(coords), None

        self.sampler = Sampler(
            len(self.positions),
            size,
            density,
            moves=[(emcee.moves.MHMove(move, ndim=size), share) for move, share in moves],
            vectorize=True,
        )
        self.sampler._random.set_state(self.state)

    @property
    def refittable(self) -> bool:
        """Whether what they propose is one proposal, which more draws may better."""
        return isinstance(self.proposal, Proposal)

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
        self.positions, self.state = (
            straightening.bent(last.coords),
            self.sampler._random.get_state(),
        )
        chain = self.sampler.get_chain()
        bent = straightening.bent(chain.reshape(-1, chain.shape[2])).reshape(chain.shape)
        return _by_ensemble(bent), _by_ensemble(self.sampler.get_log_prob())


def warmed_up(
    density: LogDensity,
    first: StudentMixture,
    seed: np.random.SeedSequence,
    peak: Floats,
    redraw: Redraw | None = None,
    most_steps: float = np.inf,
) -> Ensembles[Proposal]:
    """Ensembles that have forgotten their starts, with one proposal, refitted and frozen.

    Each begins at its own draws of a `first` proposal, so that R-hat between them can see a second
    mode; where these miss the support, near `peak`.  After each round of warm-up the proposal is
    fitted to where the walkers have been.  Rounds follow while the walkers accept the new one too
    rarely, until neither that nor their density improves any more; none begins after `most_steps`.
    """
    *seeds, last = seed.spawn(ENSEMBLES + 1)
    rng = np.random.default_rng(last)
    size = len(peak)
    starts = [_spread_start(density, first, peak, np.random.default_rng(own)) for own in seeds]
    proposal = Proposal.first(first, rng)
    state = np.random.RandomState(np.random.MT19937(last)).get_state()
    ensembles = Ensembles(density, proposal, _WARM, np.concatenate(starts), state, redraw)
    best, level, idle, taken = 0.0, -np.inf, 0, 0
    fewest = 8  # steps that a proposal is fitted to
    good = 0.5  # acceptance of independent proposals from which another round gains nothing
    climb = 0.1  # rise of the mean log density, in its standard deviations, that is no accident
    for share in _WARM_UP:
        steps = max(share * size, 2 * fewest)
        chains, log_density = ensembles.advance(steps)
        late = slice(steps // 2, None, max(steps // 24, 1))
        chains, log_density = chains[:, late], log_density[:, late]
        ensembles = _with(ensembles, fitted(chains, log_density, density, redraw, rng))
        found, values = chains.reshape(-1, size), log_density.ravel()
        accepted = acceptance(density, ensembles.proposal, found, values, rng)
        climbing = values.mean() - level > climb * values.std()
        idle = 0 if accepted > 1.1 * best or climbing else idle + 1
        taken += steps
        if accepted > good or idle == _IDLE or taken >= most_steps:
            break
        best, level = max(best, accepted), max(level, values.mean())
    # Tails that the first proposal misses were not reached yet: of a damper that may be zero the
    # 95 % point of K_CR lay half a standard deviation low in the four steps that followed.
    settling = 8
    ensembles.advance(settling)
    return ensembles


def joined(
    density: LogDensity,
    peaks: Sequence[Ensembles[Proposal]],
    held: Floats,
    seed: np.random.SeedSequence,
) -> Ensembles[SeveralPeaks]:
    """Ensembles over several peaks, warmed up about each by itself.

    Walkers are shared out by how much of the density each peak has `held`: logarithms, (K,).
    """
    own, last = seed.spawn(2)
    rng = np.random.default_rng(own)
    proposal = SeveralPeaks.of(tuple(one.proposal for one in peaks), held)
    ends = np.cumsum(shares_of(held))
    starts = []
    for ensemble in range(ENSEMBLES):
        places = (np.arange(WALKERS) + rng.uniform()) / WALKERS  # systematic: no peak by chance
        which = np.minimum(np.searchsorted(ends, places), len(peaks) - 1)
        own_walkers = slice(ensemble * WALKERS, (ensemble + 1) * WALKERS)
        starts.append(
            np.stack([peaks[k].positions[own_walkers][place] for place, k in enumerate(which)])
        )
    state = np.random.RandomState(np.random.MT19937(last)).get_state()
    redraw = peaks[0].redraw
    ensembles = Ensembles(density, proposal, _TOGETHER, np.concatenate(starts), state, redraw)
    settling = 8
    ensembles.advance(settling)
    return ensembles


def refitted(
    ensembles: Ensembles[Proposal], chains: Floats, values: Floats, rng: np.random.Generator
) -> Ensembles[Proposal]:
    """The ensembles where they are, with a proposal fitted to their `chains` (E, S, W, P).

    `values` are the log densities there, (E, S, W).
    """
    most_points = 20_000  # that a proposal is fitted to
    every = max(2, -(-values.size // most_points))
    own = fitted(chains[:, ::every], values[:, ::every], ensembles.density, ensembles.redraw, rng)
    return _with(ensembles, own)


def _with(ensembles: Ensembles[Proposal], proposal: Proposal) -> Ensembles[Proposal]:
    return replace(ensembles, proposal=proposal, share=_FROZEN)


def _by_ensemble(chain: Floats) -> Floats:
    """(steps, ensembles * walkers, ...) to (ensembles, steps, walkers, ...)."""
    split = chain.reshape(len(chain), ENSEMBLES, -1, *chain.shape[2:])
    return np.swapaxes(split, 0, 1)


def _spread_start(
    density: LogDensity, first: StudentMixture, peak: Floats, rng: np.random.Generator
) -> Floats:
    """Walkers where the density is positive, drawn from the proposal, which is wider than it.

    Where the proposal all but misses the support, draws come nearer and nearer to the peak.
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
