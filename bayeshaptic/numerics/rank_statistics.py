"""Rank-normalised R-hat and effective sample sizes of chains.

A. Vehtari, A. Gelman, D. Simpson, B. Carpenter, P.-C. Buerkner, "Rank-normalization, folding, and
localization: an improved R-hat", Bayesian Analysis 16 (2021).  The numbers are those of ArviZ,
which the tests compare them with; its import alone would take a tenth of the time of a report.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from bayeshaptic.types import Floats, Ints

_TAILS = (0.05, 0.95)
_FEWEST = 4  # draws of a chain
_LAGS_BY_ONE = 64  # a transform takes as long as some 30


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
    if chains.shape[0] < 2 or not _usable(chains):
        return np.inf
    ranked = _Ranked.of(_halves(chains))
    return _larger_rhat(ranked.scores, ranked.folded)


def of_ensembles(draws: Floats) -> tuple[float, float, float]:
    """R-hat with an ensemble as a chain, bulk and tail size with a walker as one.

    An ensemble is taken in the order of time.  The bulk size is that of the ranks, the tail size
    the smaller one of being below the 5 % and below the 95 % quantile.  The draws are sorted once
    for all three.

    Parameters
    ----------
    draws : ndarray, shape (ensemble, step, walker)
        Of an odd number of steps the first counts for nothing.

    Returns
    -------
    rhat, bulk, tail : float
        Infinite, 0 and 0 where there are none.
    """
    draws = draws[:, draws.shape[1] % 2 :]
    ensembles, steps, _ = draws.shape

    def walkers(values: NDArray[Any]) -> NDArray[Any]:
        return values.swapaxes(1, 2).reshape(-1, steps)

    def halves(values: Floats) -> Floats:
        return _halves(values.reshape(ensembles, -1))

    if not _usable(walkers(draws)):
        return np.inf, 0.0, 0.0
    ranked = _Ranked.of(draws)
    rhat = _larger_rhat(halves(ranked.scores), halves(ranked.folded)) if ensembles > 1 else np.inf
    ends = [ranked.quantile(level) for level in _TAILS]
    below = [_size(_halves(walkers((draws <= end).astype(float)))) for end in ends]
    return rhat, _size(_halves(walkers(ranked.scores))), min(below)


def _usable(chains: Floats) -> bool:
    return chains.shape[1] >= _FEWEST and bool(np.isfinite(chains).all())


def _halves(chains: NDArray[Any]) -> NDArray[Any]:
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


@dataclass(frozen=True)
class _Ranked:
    """Draws in rising order.

    Attributes
    ----------
    shape : tuple of int
        Of the draws.
    order : ndarray of int, shape (N,)
    ordered : ndarray, shape (N,)
    """

    shape: tuple[int, ...]
    order: Ints
    ordered: Floats

    @classmethod
    def of(cls, values: Floats) -> _Ranked:
        flat = values.ravel()
        order = np.argsort(flat)
        return cls(values.shape, order, flat[order])

    @property
    def scores(self) -> Floats:
        """Normal quantiles of the ranks (Blom's), ties sharing their average rank."""
        return self._scores(self.order, self.ordered)

    @property
    def folded(self) -> Floats:
        """The same of the distances from the median: two runs in order, one behind the other."""
        middle = self.ordered[[(len(self.ordered) - 1) // 2, len(self.ordered) // 2]].mean()
        away = np.abs(self.ordered - middle)
        order = np.argsort(away, kind="stable")
        return self._scores(self.order[order], away[order])

    def _scores(self, order: Ints, ordered: Floats) -> Floats:
        begins = np.append(True, ordered[1:] != ordered[:-1])
        ends = np.append(np.flatnonzero(begins), len(ordered))  # of runs of ties
        twice = ends[:-1] + ends[1:] + 1  # the average rank, from one on
        scores = np.empty(len(ordered))
        scores[order] = np.repeat(_scores_of(len(ordered))[twice], np.diff(ends))
        return scores.reshape(self.shape)

    def quantile(self, level: float) -> float:
        """By linear interpolation, as `numpy.quantile`."""
        at = level * (len(self.ordered) - 1)
        return float(np.interp(at, [int(at), int(at) + 1], self.ordered[int(at) : int(at) + 2]))


@lru_cache(maxsize=4)
def _scores_of(count: int) -> Floats:
    """Scores of twice the ranks 0 to `count`, which a column shares with the next."""
    return np.asarray(ndtri((0.5 * np.arange(2 * count + 1) - 0.375) / (count + 0.25)))


def _larger_rhat(scores: Floats, folded: Floats) -> float:
    value = max(_rhat(scores), _rhat(folded))
    return value if np.isfinite(value) else np.inf


def _rhat(chains: Floats) -> float:
    draws = chains.shape[1]
    within = chains.var(axis=1, ddof=1).mean()
    between = draws * chains.mean(axis=1).var(ddof=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sqrt((between / within + draws - 1) / draws))


def _size(chains: Floats) -> float:
    """Effective sample size; the autocorrelation is summed by Geyer's initial monotone sequence.

    Lag by lag, from the first on: of chains that mix a few say everything, and a transform takes
    all of them; it follows where a few did not.
    """
    count, draws = chains.shape
    if np.ptp(chains) < np.finfo(float).resolution:
        return float(chains.size)
    means = chains.mean(axis=1)
    by_time = np.ascontiguousarray((chains - means[:, None]).T)
    variance = np.vdot(by_time, by_time) / chains.size
    within = variance * draws / (draws - 1.0)
    total = variance + (means.var(ddof=1) if count > 1 else 0.0)

    @cache
    def transformed() -> Floats:
        power = np.zeros(draws + 1)
        for one in by_time.T:
            power += np.abs(np.fft.rfft(one, 2 * draws)) ** 2
        return np.asarray(np.fft.irfft(power)[:draws])

    def correlation(lag: int) -> float:
        if lag == 0:
            return 1.0
        if lag < _LAGS_BY_ONE:
            covariance = np.vdot(by_time[:-lag], by_time[lag:]) / chains.size
        else:
            covariance = transformed()[lag] / chains.size
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
