"""Quantiles at small risks from few draws, with their Monte-Carlo error.

Where 20 effective draws lie below a quantile of the draws, it is stated as it is.  Beyond that a
generalised Pareto distribution is fitted to the lowest draws, as in Pareto smoothed importance
sampling, and its quantile is stated; the fit must pass a test of Kolmogorov and Smirnov, and its
error be small beside the central 90 % interval, or beside what a caller has a use for.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.numerics.pareto import first_quartile, fit_pareto
from bayeshaptic.types import Floats

ENOUGH_BELOW = 20  # effective draws below a quantile that is stated as it is
PRECISE = 0.2  # of the 90 % interval: a larger error of a fitted tail, and nothing is stated
LARGEST = 0.05  # risk that a stiffness is stated for
_SHARE = 0.05  # of the draws that a tail is fitted to; halved while it does not fit
# Most of sqrt(n) times the largest difference between the draws' distribution and the fitted one:
# for eight smooth laws 95 % of fits stay below 0.9 to 1.1.
_FITS = 1.3


@dataclass(frozen=True)
class LowQuantile:
    """A quantile of a distribution that draws stand for.

    Attributes
    ----------
    value : float
    error : float
        Monte-Carlo standard deviation.
    fitted : bool
        Whether it comes from a fitted tail.
    """

    value: float
    error: float
    fitted: bool


def low_quantile(
    samples: Floats, risk: float, effective: Callable[[float], float], enough: float = 0.0
) -> LowQuantile | None:
    """The quantile at a small risk, from draws or from a tail fitted to the lowest of them.

    Parameters
    ----------
    samples : ndarray, shape (n,)
        Infinite where nothing is limited.
    risk : float
    effective : callable
        From a threshold to the number of independent draws that would give the share of samples
        below it as well.
    enough : float
        An error that is small enough for any use, however narrow the interval is.

    Returns
    -------
    LowQuantile or None
        None where the draws do not say it, or do not say that of twice the risk: the lowest draws
        may be many, and independent, where those above them are few.
    """
    if 2 * risk <= LARGEST and low_quantile(samples, 2 * risk, effective, enough) is None:
        return None
    ordered = np.sort(samples)
    own = quantile_with_error(ordered, risk, effective)
    # Below a lowest value that many draws have, none where no stiffness is stable, there are none.
    least = own.value <= ordered[0]
    if risk * effective(np.nextafter(own.value, np.inf) if least else own.value) >= ENOUGH_BELOW:
        return own
    low, high = quantiles(ordered, np.array([0.05, 0.95]))
    share = max(_SHARE, 5 * risk)
    while share > risk:  # the same tails for all risks: none is stated where a larger one is not
        tail = _fitted(ordered, risk, share, effective)
        if tail is not None:
            return tail if tail.error <= max(PRECISE * (high - low), enough) else None
        share /= 2
    return None


def quantile_with_error(
    ordered: Floats, p: float, effective: Callable[[float], float]
) -> LowQuantile:
    """A quantile of draws with its Monte-Carlo error.

    Parameters
    ----------
    ordered : ndarray, shape (n,)
        The draws in ascending order.
    p : float
        Probability of what is below.
    effective : callable
        From a threshold to the number of independent draws that would give the share below it as
        well.

    Returns
    -------
    LowQuantile
        Its error is half of what one standard deviation of p to either side covers.
    """
    value = float(quantiles(ordered, p))
    sd = np.sqrt(p * (1 - p) / max(effective(value), 1.0))
    low, high = quantiles(ordered, np.clip([p - sd, p + sd], 0, 1))
    return LowQuantile(value, 0.5 * float(high - low) if low < high else 0.0, False)


def quantiles(samples: Floats, p: ArrayLike) -> Any:
    """Quantiles of samples of which some may be infinite; of the shape of `p`."""
    levels = np.asarray(p, float)
    if np.isfinite(samples).all():
        return np.quantile(samples, levels)
    # Nothing can be interpolated between a number and infinity.
    return np.quantile(samples, levels, method="inverted_cdf")


def _fitted(
    ordered: Floats, risk: float, share: float, effective: Callable[[float], float]
) -> LowQuantile | None:
    """From a tail fitted to the lowest `share` of the draws; None where they are too few or odd."""
    count = int(share * len(ordered))
    threshold = float(ordered[count])
    worth = share * effective(threshold)
    fewest = 40  # effective draws of a tail
    if worth < fewest or not np.isfinite(threshold):
        return None
    excess = (threshold - ordered[:count])[::-1]
    if not first_quartile(excess) > 0:
        return None
    tail = fit_pareto(excess).towards_exponential(worth)
    off = np.abs(np.arange(0.5, count) / count - (1 - tail.above(excess))).max()
    if not off * np.sqrt(worth) < _FITS:
        return None
    beyond = risk / share
    # The share below the threshold is an estimate, too: it moves the quantile along the tail.
    along = tail.scale * beyond**-tail.shape
    variance = tail.variance(beyond, worth) + along**2 * (1 - share) / worth
    value = threshold - tail.quantile(beyond)
    positive = ordered[0] > 0  # then so is what is below it
    return LowQuantile(max(value, 0.0) if positive else value, float(np.sqrt(variance)), True)
