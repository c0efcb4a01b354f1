"""How many independent draws a set of chains is worth.

Here a chain counts as it is.  In `rank_statistics.py`, which judges whether chains have converged,
it is split in halves and its draws are ranked first.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray


def effective_draws(chains: ArrayLike) -> float:
    """Effective sample size of the mean.

    Each walker is a chain: walkers laid end to end would count as independent what is not.  Chains
    of fewer than four steps are taken as independent draws and count as they are; so does a
    constant.

    Parameters
    ----------
    chains : array_like, shape (C, S)
        C chains of S steps.

    Returns
    -------
    float
        At most C S log10(C S): chains whose steps repel each other are worth more than they have.

    References
    ----------
    A. Vehtari et al., "Rank-normalization, folding, and localization: an improved R-hat",
    Bayesian Analysis 16 (2021), equations (10)-(13), with Geyer's initial monotone sequence.
    """
    x = np.asarray(chains, float)
    count, steps = x.shape
    total = count * steps
    if steps < 4 or np.ptp(x) == 0:
        return float(total)
    mean = x.mean(axis=1)
    covariance = _mean_autocovariance(x - mean[:, None])
    within = covariance[0] * steps / (steps - 1)
    spread = within * (steps - 1) / steps + (np.var(mean, ddof=1) if count > 1 else 0.0)
    correlation = 1 - (within - covariance * steps / (steps - 1)) / spread
    correlation[0] = 1.0
    pairs = correlation[: steps // 2 * 2].reshape(-1, 2).sum(axis=1)
    ended = np.flatnonzero(pairs <= 0)
    pairs = pairs[: ended[0] if ended.size else None]
    time = 2 * np.minimum.accumulate(pairs).sum() - 1
    return float(min(total / max(time, 1 / np.log10(total)), total * np.log10(total)))


def _mean_autocovariance(centred: NDArray[np.float64]) -> NDArray[np.float64]:
    """Autocovariance (divided by S) at lags 0..S-1, averaged over the chains (C, S)."""
    steps = centred.shape[1]
    size = 1 << (2 * steps - 1).bit_length()
    power = np.mean(np.abs(np.fft.rfft(centred, size, axis=1)) ** 2, axis=0)
    return np.fft.irfft(power, size)[:steps] / steps
