"""Rank-normalised R-hat and effective sample sizes of chains.

A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Buerkner, "Rank-normalization, folding, and
localization: an improved R-hat", Bayesian Analysis 16 (2021).  The numbers are those of ArviZ,
which the tests compare them with; its import alone would take a tenth of the time of a report.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.special import ndtri

from bayeshaptic.types import Floats

_TAILS = (0.05, 0.95)
_FEWEST = 4  # draws of a chain


def split_rhat(chains: Floats) -> float:
    """The larger one of R-hat of the ranks and of the ranks of the distance from the median.

    Parameters
    ----------
    chains : ndarray, shape (chain, draw)

    Returns
    -------
    float
        Infinite where there is none.
    """
    if chains.shape[0] < 2 or chains.shape[1] < _FEWEST or not np.isfinite(chains).all():
        return np.inf
    halves = _halves(chains)
    away = np.abs(halves - np.median(halves))
    value = max(_rhat(_normal_scores(halves)), _rhat(_normal_scores(away)))
    return value if np.isfinite(value) else np.inf


def bulk_size(chains: Floats) -> float:
    """Effective sample size of the ranks of chains (chain, draw); 0 where there is none."""
    return _size(_normal_scores(_halves(chains))) if _usable(chains) else 0.0


def tail_size(chains: Floats) -> float:
    """The smaller effective sample size of being below the 5 % and below the 95 % quantile."""
    if not _usable(chains):
        return 0.0
    ends = np.quantile(chains, _TAILS)
    return min(_size(_halves((chains <= end).astype(float))) for end in ends)


def _usable(chains: Floats) -> bool:
    return chains.shape[1] >= _FEWEST and bool(np.isfinite(chains).all())


def _halves(chains: Floats) -> Floats:
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


def _normal_scores(values: Floats) -> Floats:
    """Normal quantiles of the ranks (Blom's), ties sharing their average rank."""
    flat = values.ravel()
    order = np.argsort(flat)
    ordered = flat[order]
    begins = np.append(True, ordered[1:] != ordered[:-1])
    ends = np.append(np.flatnonzero(begins), len(flat))  # of runs of ties, one after the other
    twice = ends[:-1] + ends[1:] + 1  # the average rank, from one on
    scores = np.empty(len(flat))
    scores[order] = np.repeat(_scores_of(len(flat))[twice], np.diff(ends))
    return scores.reshape(values.shape)


@lru_cache(maxsize=4)
def _scores_of(count: int) -> Floats:
    """Scores of twice the ranks 0 to `count`, which a column shares with the next."""
    return np.asarray(ndtri((0.5 * np.arange(2 * count + 1) - 0.375) / (count + 0.25)))


def _rhat(chains: Floats) -> float:
    draws = chains.shape[1]
    within = chains.var(axis=1, ddof=1).mean()
    between = draws * chains.mean(axis=1).var(ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sqrt((between / within + draws - 1) / draws))


def _size(chains: Floats) -> float:
    """Effective sample size; the autocorrelation is summed by Geyer's initial monotone sequence.

    Lag by lag, from the first on: of chains that mix a few say everything, and a transform would
    take all of them.
    """
    count, draws = chains.shape
    if np.ptp(chains) < np.finfo(float).resolution:
        return float(chains.size)
    means = chains.mean(axis=1)
    by_time = np.ascontiguousarray((chains - means[:, None]).T)
    variance = np.vdot(by_time, by_time) / chains.size
    within = variance * draws / (draws - 1.0)
    total = variance + (means.var(ddof=1) if count > 1 else 0.0)

    def correlation(lag: int) -> float:
        if lag == 0:
            return 1.0
        covariance = np.vdot(by_time[:-lag], by_time[lag:]) / chains.size
        return float(1.0 - (within - covariance) / total)

    time, pair = -1.0, np.inf
    last = 2 * max((draws - 3) // 2, 0)
    for lag in range(0, last, 2):
        even = correlation(lag)
        both = even + correlation(lag + 1)
        if both <= 0:
            break
        pair = min(pair, both)
        time += 2 * pair
    else:
        even = correlation(last)
    time += max(even, 0.0)
    size = chains.size / max(time, 1 / np.log10(chains.size))
    return float(size) if np.isfinite(size) else 0.0
