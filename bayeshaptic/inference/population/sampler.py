"""Sampling what the recordings of a study share, spreads and correlations, with emcee."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.inference.diagnostics import RHAT_LIMIT, Diagnostics, diagnose
from bayeshaptic.inference.population.walkers import EVERY, Walkers
from bayeshaptic.inference.sampling.ensembles import ENSEMBLES, WALKERS, Ensembles, refitted
from bayeshaptic.numerics.mixture import student
from bayeshaptic.types import Floats

ESS = 500.0
_MOST_STEPS = 5000
TOLERABLE = 1.02  # R-hat from which chains are not to be used


class Level(Protocol):
    """Hyperparameters with a density, and where to begin with them; Q numbers."""

    def log_density(self, phi: Floats) -> Floats:
        """Log density of vectors phi of shape (B, Q), up to a constant; shape (B,)."""

    def guess(self) -> tuple[Floats, Floats]:
        """A middle and a width of each, shape (Q,)."""


@dataclass(frozen=True)
class LevelChains:
    """Chains of the hyperparameters.

    Attributes
    ----------
    chains : ndarray, shape (ensembles, steps, walkers, Q)
    diagnostics : Diagnostics
    walkers : tuple of Walkers
        Where they stand, to go on from.
    """

    chains: Floats = field(repr=False)
    diagnostics: Diagnostics
    walkers: tuple[Walkers, ...] = field(default=(), repr=False)

    def thinned(self, count: int, rng: np.random.Generator) -> Floats:
        """Draws in random order, shape (count, Q); some come again where there are fewer."""
        flat = self.chains.reshape(-1, self.chains.shape[-1])
        return flat[rng.choice(len(flat), count, replace=len(flat) < count)]

    def in_order(self, count: int) -> tuple[Floats, int]:
        """Draws walker after walker, evenly spread over the steps.

        Nothing is drawn twice, and how far neighbours are alike can still be seen.

        Parameters
        ----------
        count : int
            The most draws to take; a draw of each walker at least.

        Returns
        -------
        draws : ndarray, shape (n, Q)
        walkers : int
            Number of chains of equal length that the draws consist of.
        """
        ensembles, steps, walkers, size = self.chains.shape
        kept = max(1, min(steps, count // (ensembles * walkers)))
        pick = np.linspace(0, steps - 1, kept).astype(int)
        by_walker = self.chains[:, pick].transpose(0, 2, 1, 3)
        return by_walker.reshape(-1, size), ensembles * walkers

    def resting(self) -> LevelChains:
        """Without the walkers: what can be sent to another process."""
        return replace(self, walkers=())

    @property
    def notices(self) -> tuple[Notice, ...]:
        """A warning where R-hat is too large, else nothing."""
        worst = float(self.diagnostics.rhat.max())
        if worst < RHAT_LIMIT:
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
        So many and no more; by default until R-hat is below 1.01 with 500 effective draws, or
        5,000 steps are over.

    Returns
    -------
    LevelChains
    """
    density = level.log_density
    if before is None:
        walkers = [_begin(level, own) for own in seed.spawn(ENSEMBLES)]
        warm_up = 200
        for one in walkers:
            one.advance(warm_up)
    else:
        walkers = [replace(one, density=density) for one in before.walkers]
    again = 40  # steps to forget a description that has changed a little
    for one in walkers:
        one.advance(again)
    level_steps = 600
    joined = _advance(walkers, level_steps if steps is None else steps)
    diagnostics = diagnose(joined)
    while steps is None and EVERY * joined.shape[1] < _MOST_STEPS and not _done(diagnostics):
        gone = EVERY * joined.shape[1]
        more = int(np.clip(gone * (1.1 * ESS / diagnostics.ess - 1), 0.3 * gone, gone))
        joined = np.concatenate([joined, _advance(walkers, more)], axis=1)
        diagnostics = diagnose(joined)
    return LevelChains(joined, diagnostics, tuple(walkers))


def run_ensembles(ensembles: Ensembles, rng: np.random.Generator, ess: float) -> LevelChains:
    """Draws of a few parameters on ridges, from ensembles that are warmed up.

    The proposal is fitted again, up to four times, until a frozen one gives enough effective draws;
    or until several times the steps give hardly more of them, because walkers hang that no longer
    run frees.

    Parameters
    ----------
    ensembles : Ensembles
    rng : numpy.random.Generator
        For the fits of the proposal.
    ess : float
        Effective draws to reach, with R-hat below 1.01.

    Returns
    -------
    LevelChains
        Of the last run; whether that is enough its `diagnostics` tell.
    """
    first_steps = 100
    steps = first_steps
    refits = 4  # at most
    hardly, before = 1.2, 0.0  # times the effective draws of a run that was half as long or shorter
    for _ in range(refits):
        chains, values = ensembles.advance(steps)
        diagnostics = diagnose(chains)
        if diagnostics.ess >= ess and diagnostics.rhat.max() < RHAT_LIMIT:
            break
        if diagnostics.ess < hardly * before:
            break
        before = diagnostics.ess
        ensembles = refitted(ensembles, chains, values, rng)
        steps = int(np.clip(1.2 * steps * ess / diagnostics.ess, 2 * steps, 4 * steps))
    return LevelChains(chains, diagnostics)


def _done(diagnostics: Diagnostics) -> bool:
    """Whether chains of hyperparameters are long enough."""
    return bool(diagnostics.ess >= ESS and diagnostics.rhat.max() < RHAT_LIMIT)


def _advance(walkers: list[Walkers], steps: int) -> Floats:
    """Positions of all ensembles, shape (E, S, W, Q)."""
    return np.stack([one.advance(steps) for one in walkers])


def _begin(level: Level, seed: np.random.SeedSequence) -> Walkers:
    """Walkers around the first guess, wider than what is expected to be found."""
    middle, width = level.guess()
    proposal = student(middle, np.diag(width**2), 8.0)
    rng = np.random.default_rng(seed)
    points = np.empty((0, len(middle)))
    for shrink in 0.8 ** np.arange(40):
        drawn = middle + shrink * (proposal.sample(rng, 4 * WALKERS) - middle)
        points = np.concatenate([points, drawn[np.isfinite(level.log_density(drawn))]])
        if len(points) >= WALKERS:
            break
    state = np.random.RandomState(np.random.MT19937(seed)).get_state()
    return Walkers(level.log_density, points[:WALKERS], state)
