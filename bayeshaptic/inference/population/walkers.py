"""Walkers for many hyperparameters that hardly depend on each other.

Spreads that may be next to none have a shoulder in their logarithm, and no proposal for all of them
at once is accepted often.  Differences of other walkers in a few coordinates at a time are (C. J.
F. ter Braak, "A Markov chain Monte Carlo version of the genetic algorithm differential evolution",
Statistics and Computing 16, 2006; J. A. Vrugt et al., "Accelerating Markov chain Monte Carlo
simulation by differential evolution with self-adaptive randomized subspace sampling",
International Journal of Nonlinear Sciences and Numerical Simulation 10, 2009).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bayeshaptic.types import Floats, LogDensity

EVERY = 5  # steps that are kept: neighbours are nearly the same


@dataclass
class Walkers:
    """One emcee ensemble that moves in a few coordinates at a time.

    Attributes
    ----------
    density : callable
        Log density of points of shape (B, Q).
    positions : ndarray, shape (walkers, Q)
        Where the walkers stand now.
    state : tuple
        State of a `numpy.random.RandomState`.
    """

    density: LogDensity
    positions: Floats
    state: Any
    sampler: Any = field(init=False)

    def __post_init__(self) -> None:
        import emcee

        self.sampler = emcee.EnsembleSampler(
            *self.positions.shape, self.density, moves=_subspace_move(), vectorize=True
        )
        self.sampler.random_state = self.state
        # What emcee makes of it prints all walkers where it is stopped.
        self.sampler.log_prob_fn = self.density

    def advance(self, steps: int) -> Floats:
        """Go on by `steps`, and hand back every fifth position: (steps // 5, walkers, Q)."""
        self.sampler.reset()
        last = self.sampler.run_mcmc(
            self.positions, steps // EVERY, skip_initial_state_check=True, thin_by=EVERY
        )
        self.positions, self.state = last.coords, self.sampler.random_state
        return np.asarray(self.sampler.get_chain(), float)


def _subspace_move() -> Any:
    """The move of `subspace_steps` as emcee takes it."""
    from emcee.moves.red_blue import RedBlueMove

    class Subspace(RedBlueMove):  # type: ignore[misc]
        def get_proposal(
            self, walkers: Floats, others: Sequence[Floats], rng: np.random.RandomState
        ) -> tuple[Floats, Floats]:
            return subspace_steps(walkers, np.concatenate(list(others)), rng), np.zeros(
                len(walkers)
            )

    return Subspace()


def subspace_steps(walkers: Floats, others: Floats, rng: np.random.RandomState) -> Floats:
    """Propose a step for each walker: the difference of two others, in a few coordinates.

    A step is as probable there as back, so that proposals need no correction.

    Parameters
    ----------
    walkers : ndarray, shape (W, Q)
        Those that are to move.
    others : ndarray, shape (V, Q)
        Those that stand still meanwhile.
    rng : numpy.random.RandomState

    Returns
    -------
    ndarray, shape (W, Q)
        Each moved in one to four coordinates, by a length around 2.38 / sqrt(2 d) for d of them
        (ter Braak 2006).
    """
    count, size = walkers.shape
    most = 4  # coordinates at a time
    many = rng.randint(1, min(most, size) + 1, size=count)
    order = np.argsort(rng.rand(count, size), axis=1).argsort(axis=1)
    one = rng.randint(len(others), size=count)
    other = (one + rng.randint(1, len(others), size=count)) % len(others)
    stretch = 0.3  # log standard deviation of the length of a step
    length = 2.38 / np.sqrt(2 * many) * np.exp(stretch * rng.randn(count))
    jitter = 1e-5
    step = length[:, None] * (others[one] - others[other]) + jitter * rng.randn(count, size)
    return np.where(order < many[:, None], walkers + step, walkers)
