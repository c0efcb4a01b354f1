"""Has the sampler converged?  R-hat between ensembles, effective sample size over walkers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.arviz_statistics import effective_sample_size, split_rhat
from bayeshaptic.types import Floats

RHAT_LIMIT = 1.01


@dataclass(frozen=True)
class Diagnostics:
    """Convergence of every column.

    Attributes
    ----------
    rhat : ndarray, shape (P,)
        Rank-normalised split R-hat with each ensemble as a chain (the walkers of one ensemble are
        not independent chains).
    ess_bulk, ess_tail : ndarray, shape (P,)
        Effective sample sizes with each walker as a chain (interleaved walkers would look like
        far too many draws).
    """

    rhat: Floats
    ess_bulk: Floats
    ess_tail: Floats

    @property
    def ess(self) -> float:
        """The smallest effective sample size, bulk or tail, of any column."""
        return float(min(self.ess_bulk.min(), self.ess_tail.min()))


def diagnose(chains: Floats) -> Diagnostics:
    """Diagnostics of chains of shape (ensembles, steps, walkers, P).

    A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Buerkner, "Rank-normalization, folding,
    and localization: an improved R-hat", Bayesian Analysis 16 (2021); computed by ArviZ.
    """
    ensembles, steps, walkers, size = chains.shape
    # A whole ensemble as a chain, in the order of time.
    as_ensembles = chains.reshape(ensembles, steps * walkers, size)
    as_walkers = chains.transpose(0, 2, 1, 3).reshape(ensembles * walkers, steps, size)
    return Diagnostics(
        np.array([split_rhat(as_ensembles[..., p]) for p in range(size)]),
        np.array([effective_sample_size(as_walkers[..., p], "bulk") for p in range(size)]),
        np.array([effective_sample_size(as_walkers[..., p], "tail") for p in range(size)]),
    )
