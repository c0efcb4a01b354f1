"""Has the sampler converged?  R-hat between ensembles, effective sample size over walkers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.numerics.rank_statistics import of_ensembles
from bayeshaptic.types import Floats

RHAT_LIMIT = 1.01
_FEWEST = 8000  # draws that statistics are computed from: R-hat is known to some thousandths then


@dataclass(frozen=True, eq=False)
class Diagnostics:
    """Convergence of every column.

    Attributes
    ----------
    rhat : ndarray, shape (P,)
        Rank-normalised split R-hat with each ensemble as a chain.
    ess_bulk, ess_tail : ndarray, shape (P,)
        Effective sample sizes with each walker as a chain (interleaved walkers would look like
        far too many draws).
    """

    rhat: Floats
    ess_bulk: Floats
    ess_tail: Floats

    @property
    def fewest(self) -> Floats:
        """Effective sample size of every column, bulk or tail, shape (P,)."""
        return np.minimum(self.ess_bulk, self.ess_tail)

    @property
    def ess(self) -> float:
        """The smallest effective sample size, bulk or tail, of any column."""
        return float(self.fewest.min())


def diagnose(chains: Floats, ess: float | None = None) -> Diagnostics:
    """Diagnostics of chains of shape (ensembles, steps, walkers, P).

    A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Buerkner, "Rank-normalization, folding,
    and localization: an improved R-hat", Bayesian Analysis 16 (2021).

    Parameters
    ----------
    chains : ndarray
    ess : float, optional
        So many effective draws are of interest: longer chains are thinned to ten times that, and
        to what R-hat needs.
    """
    for_ess = 10.0
    counted = chains if ess is None else thinned(chains, max(for_ess * ess, _FEWEST))
    columns = [of_ensembles(counted[..., p]) for p in range(chains.shape[-1])]
    return Diagnostics(*np.array(columns).T)


def thinned(chains: Floats, draws: float) -> Floats:
    """Every so many steps of chains (ensembles, S, walkers, P), at least `draws` draws if there."""
    ensembles, steps, walkers = chains.shape[:3]
    fewest_steps = 16  # of a chain, for its autocorrelation
    wanted = max(draws / (ensembles * walkers), fewest_steps)
    every = max(int(steps / wanted), 1)
    return chains[:, every - 1 :: every]
