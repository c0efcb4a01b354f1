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
    first = np.flatnonzero(begins)
    twice = first + np.append(first[1:], len(flat)) + 1  # the average rank, from one on
    scores = np.empty(len(flat))
    scores[order] = _scores_of(len(flat))[twice][np.cumsum(begins) - 1]
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
    """Effective sample size; the autocorrelation is summed by Geyer's initial monotone sequence."""
    count, draws = chains.shape
    if np.ptp(chains) < np.finfo(float).resolution:
        return float(chains.size)
    covariance = _autocovariance(chains)
    within = covariance[0] * draws / (draws - 1.0)
    total = covariance[0] + (chains.mean(axis=1).var(ddof=1) if count > 1 else 0.0)
    correlation = 1.0 - (within - covariance) / total
    correlation[0] = 1.0
    most = max((draws - 3) // 2, 0)
    pairs = correlation[: 2 * most].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)
    last = int(ends[0]) if len(ends) else most
    time = 2 * np.minimum.accumulate(pairs[:last]).sum() + max(correlation[2 * last], 0.0) - 1.0
    size = chains.size / max(time, 1 / np.log10(chains.size))
    return float(size) if np.isfinite(size) else 0.0


def _autocovariance(chains: Floats) -> Floats:
    """At every lag, the mean of all chains, shape (draw,)."""
    from scipy.fft import irfft, next_fast_len, rfft

    draws = chains.shape[1]
    length = next_fast_len(2 * draws)
    spectrum = rfft(chains - chains.mean(axis=1, keepdims=True), length, axis=1)
    power = np.einsum("cf,cf->f", spectrum.view(float), spectrum.view(float))
    return irfft(power[::2] + power[1::2], length)[:draws] / chains.size
