"""Independent emcee ensembles with a frozen proposal: warm-up, then batches of steps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.importance import Adapted
from bayeshaptic.inference.mixture import StudentMixture, fit_student_mixture

Floats = NDArray[np.float64]
ENSEMBLES = 4
WALKERS = 64
_WARM_UP = 80
_COMPONENTS = 3


@dataclass
class Ensemble:
    """One emcee ensemble with its own random state.

    emcee copies the global random state into every sampler: without a state of its own,
    "independent" ensembles would be identical.
    """

    density: Callable[[Floats], Floats]
    proposal: StudentMixture
    share: float
    positions: Floats
    state: Any
    sampler: Any = field(init=False)

    def __post_init__(self) -> None:
        import emcee

        def independence(coords: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
            generator = np.random.default_rng(rng.randint(2**31))
            drawn = self.proposal.sample(generator, len(coords))
            return drawn, self.proposal.log_density(coords) - self.proposal.log_density(drawn)

        size = self.positions.shape[1]
        moves = [
            (emcee.moves.MHMove(independence, ndim=size), self.share),
            (emcee.moves.DEMove(), 1 - self.share),
        ]
        self.sampler = emcee.EnsembleSampler(
            len(self.positions), size, self.density, moves=moves, vectorize=True
        )
        self.sampler.random_state = self.state

    def advance(self, steps: int) -> tuple[Floats, Floats]:
        """Go on by `steps`: positions (steps, walkers, P) and log densities (steps, walkers)."""
        self.sampler.reset()
        # The walkers are checked for independence at the start only; later they may well meet.
        last = self.sampler.run_mcmc(self.positions, steps, skip_initial_state_check=True)
        self.positions, self.state = last.coords, self.sampler.random_state
        return self.sampler.get_chain(), self.sampler.get_log_prob()

    @property
    def acceptance(self) -> float:
        return float(np.mean(self.sampler.acceptance_fraction))


def warmed_up(
    density: Callable[[Floats], Floats], adapted: Adapted, seed: np.random.SeedSequence
) -> list[Ensemble]:
    """Ensembles that have forgotten their starts, with one proposal, refitted and frozen.

    Each begins at its own widened draws, so that R-hat between them can see a second mode.
    """
    seeds = seed.spawn(2 * ENSEMBLES + 1)
    histories = []
    warm = []
    for own, later in zip(seeds[:ENSEMBLES], seeds[ENSEMBLES:-1], strict=True):
        rng = np.random.default_rng(own)
        start = _spread_start(density, adapted, rng)
        ensemble = Ensemble(density, adapted.proposal, 0.6, start, _state(own))
        chain, _ = ensemble.advance(_WARM_UP)
        histories.append(chain[_WARM_UP // 2 :: 2].reshape(-1, chain.shape[2]))
        warm.append((ensemble.positions, later))
    found = np.concatenate(histories)
    rng = np.random.default_rng(seeds[-1])
    proposal = fit_student_mixture(found, np.ones(len(found)), _COMPONENTS, 10.0, rng)
    proposal = proposal.with_component(adapted.proposal, 0.1)
    return [Ensemble(density, proposal, 0.75, positions, _state(s)) for positions, s in warm]


def _spread_start(
    density: Callable[[Floats], Floats], adapted: Adapted, rng: np.random.Generator
) -> Floats:
    """Walkers where the density is positive: from the proposal, which is wider than the target."""
    start = np.empty((0, adapted.points.shape[1]))
    for _ in range(50):
        drawn = adapted.proposal.sample(rng, 4 * WALKERS)
        start = np.concatenate([start, drawn[np.isfinite(density(drawn))]])
        if len(start) >= WALKERS:
            return start[:WALKERS]
    # The proposal all but misses the support: fall back on the best points that are known.
    best = np.argsort(-adapted.weights)[: WALKERS - len(start)]
    return np.concatenate([start, adapted.points[best]])


def _state(seed: np.random.SeedSequence) -> Any:
    return np.random.RandomState(np.random.MT19937(seed)).get_state()
