"""Sampling what the recordings of a study share, spreads and correlations, with emcee."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import Notice
from bayeshaptic.inference.diagnostics import Diagnostics, diagnose
from bayeshaptic.inference.ensembles import Ensemble, refitted, warmed_up
from bayeshaptic.inference.importance import Adapted
from bayeshaptic.inference.mixture import student

Floats = NDArray[np.float64]

ESS = 500.0
_RHAT = 1.03
_AGAIN = 40  # steps to forget a description that has changed a little
_FIRST_STEPS = 100
_MOST_STEPS = 1000
_TOLERABLE = 1.05  # R-hat up to which it is worth no warning


class Level(Protocol):
    """Hyperparameters with a density, and where to begin with them."""

    def log_density(self, phi: Floats) -> Floats:
        """Log density of vectors of shape (B, Q); shape (B,)."""

    def guess(self) -> tuple[Floats, Floats]:
        """A middle and a width of each, shape (Q,)."""


@dataclass(frozen=True)
class LevelChains:
    """Chains of the hyperparameters.

    Attributes
    ----------
    chains : ndarray, shape (ensembles, steps, walkers, Q)
    diagnostics : Diagnostics
    ensembles : tuple of Ensemble
        Where they stand, to go on from.
    """

    chains: Floats = field(repr=False)
    diagnostics: Diagnostics
    ensembles: tuple[Ensemble, ...] = field(repr=False)

    def thinned(self, count: int, rng: np.random.Generator) -> Floats:
        """`count` draws, shape (count, Q), in random order."""
        flat = self.chains.reshape(-1, self.chains.shape[-1])
        return flat[rng.choice(len(flat), count, replace=len(flat) < count)]

    def resting(self) -> LevelChains:
        """Without the ensembles: what can be sent to another process."""
        return replace(self, ensembles=())

    @property
    def notices(self) -> tuple[Notice, ...]:
        worst = float(self.diagnostics.rhat.max())
        if worst < _TOLERABLE:
            return ()
        text = (
            f"The sampler of the population has not converged: R-hat is {worst:.3f} with "
            f"{self.diagnostics.ess:.0f} effective draws; its intervals may be too narrow."
        )
        return (Notice("warning", "population", text),)


def sample_level(
    level: Level,
    seed: np.random.SeedSequence,
    before: LevelChains | None = None,
    steps: int | None = None,
) -> LevelChains:
    """Draw hyperparameters from the posterior of what a study's recordings share.

    Parameters
    ----------
    level : Level
    seed : numpy.random.SeedSequence
    before : LevelChains, optional
        Chains of nearly the same, to go on from.
    steps : int, optional
        So many and no more; by default until R-hat is below 1.03 with 500 effective draws.
    """
    density = level.log_density
    if before is None:
        ensembles = warmed_up(density, _begin(level, seed), seed)
    else:
        ensembles = [replace(one, density=density) for one in before.ensembles]
        for ensemble in ensembles:
            ensemble.advance(_AGAIN)
    joined, values = _advance(ensembles, _FIRST_STEPS if steps is None else steps)
    diagnostics = diagnose(joined)
    if steps is None and not _done(diagnostics):
        rng = np.random.default_rng(seed.spawn(1)[0])
        ensembles = refitted(ensembles, joined, values, rng)
        joined, _ = _advance(ensembles, _FIRST_STEPS)
        diagnostics = diagnose(joined)
    while steps is None and joined.shape[1] < _MOST_STEPS and not _done(diagnostics):
        more = int(np.clip(joined.shape[1] * (1.1 * ESS / diagnostics.ess - 1), 40, 320))
        joined = np.concatenate([joined, _advance(ensembles, more)[0]], axis=1)
        diagnostics = diagnose(joined)
    return LevelChains(joined, diagnostics, tuple(ensembles))


def _done(diagnostics: Diagnostics) -> bool:
    return bool(diagnostics.ess >= ESS and diagnostics.rhat.max() < _RHAT)


def _advance(ensembles: list[Ensemble], steps: int) -> tuple[Floats, Floats]:
    """Positions and log densities of all ensembles, shapes (E, S, W, Q) and (E, S, W)."""
    runs = [ensemble.advance(steps) for ensemble in ensembles]
    return np.stack([chain for chain, _ in runs]), np.stack([values for _, values in runs])


def _begin(level: Level, seed: np.random.SeedSequence) -> Adapted:
    """A wide proposal around the first guess."""
    middle, width = level.guess()
    proposal = student(middle, np.diag(width**2), 8.0)
    points = proposal.sample(np.random.default_rng(seed.spawn(1)[0]), 64)
    return Adapted(proposal, points, np.full(64, 1 / 64), 0.0)
