"""Normals cut off at both ends, and normals of which only one side of zero is possible.

Kernels elsewhere contain it: they are to be compiled anew where it is changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats

FAR = 37.0  # standard deviations: beyond them a double holds no probability
_THIN = 1e-2  # standard deviations: a density is flat over less


@kernel(inline=True)
def below(z: float) -> float:
    """Probability of a standard normal below `z`."""
    return 0.5 * math.erfc(-z * math.sqrt(0.5))


@kernel(inline=True)
def density(z: float) -> float:
    """Of a standard normal."""
    return math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)


@kernel(inline=True)
def moments(
    low: float, high: float, one: float, lower: float, upper: float
) -> tuple[float, float, float]:
    """Probability of a standard normal between two ends, and its mean and variance there.

    `one` is the probability as a difference of two, `lower` and `upper` are densities at the ends.
    """
    width = high - low
    at, spread = 0.5 * (low + high), 1.0
    if width < _THIN:
        return density(at) * width, at, width * width / 12
    if one > 1e-300:
        at = min(max((lower - upper) / one, low), high)
        spread = 1 - at * at
        if lower > 0:
            spread += low * lower / one
        if upper > 0:
            spread -= high * upper / one
        spread = min(max(spread, 1e-2 * min(1.0, width * width)), 1.0)
    return one, at, spread


@kernel(inline=True)
def between(low: float, high: float) -> tuple[float, float, float]:
    """Probability of a standard normal between two ends, and its mean and variance there."""
    flip = low + high > 0  # the tail that is the smaller, so that no digits are lost
    if flip:
        low, high = -high, -low
    one, at, spread = moments(low, high, below(high) - below(low), density(low), density(high))
    return one, -at if flip else at, spread


def _cut_at_zero(ratios: Floats, skews: Floats) -> tuple[Floats, Floats]:
    """Of normals that are cut off at zero: skewness, and where and of what they are cut.

    Parameters
    ----------
    ratios : ndarray, shape (R,)
        Means over standard deviations.
    skews : ndarray, shape (S,)

    Returns
    -------
    tuple of ndarray, shapes (R,) and (S, 3)
        Skewness over `ratios`; over `skews` the end, and the mean and the standard deviation before
        it is cut, of that which has mean zero and variance one.
    """
    from scipy.special import log_ndtr

    mean = np.linspace(-12.0, 6.0, 4001)  # before it is cut, of variance one
    hazard = np.exp(-0.5 * mean**2 - 0.5 * np.log(2 * np.pi) - log_ndtr(mean))
    at = mean + hazard
    sd = np.sqrt(1 - hazard * at)
    skew = hazard * (2 * hazard**2 + 3 * mean * hazard + mean**2 - 1) / sd**3
    cuts = [np.interp(-skews, -skew, one) for one in (-at / sd, (mean - at) / sd, 1 / sd)]
    return np.interp(ratios, at / sd, skew), np.column_stack(cuts)


_RATIO, _RATIO_STEP = 1.02, 0.06  # next to 1 is the exponential; above 4.5 nothing is cut off
_SKEW_STEP = LEAST_SKEW = 0.02  # a normal of less is not cut off
_OF_RATIO, _OF_SKEW = _cut_at_zero(
    np.asarray(_RATIO + _RATIO_STEP * np.arange(59)), np.asarray(_SKEW_STEP * np.arange(91))
)


@kernel(inline=True)
def skewness(ratio: float) -> float:
    """Of a normal cut off at zero, whose mean is so many times its standard deviation."""
    at = max((ratio - _RATIO) / _RATIO_STEP, 0.0)
    if at >= len(_OF_RATIO) - 1:
        return 0.0
    i = int(at)
    return _OF_RATIO[i] + (at - i) * (_OF_RATIO[i + 1] - _OF_RATIO[i])


@kernel(inline=True)
def handed_on(side: int, velocity: float, variance: float, shared: float) -> float:
    """Skewness of what a velocity of one sign makes a part of, `shared` its covariance over its sd.

    The part of the variance counts to the power of three halves: the rest is a normal's.
    """
    if side == 0 or not variance > 0 or not shared > 0:
        return 0.0
    known = math.sqrt(variance)
    return skewness(side * velocity / known) * min(shared / known, 1.0) ** 3


@kernel(inline=True)
def cut_off(skew: float) -> tuple[float, float, float, float]:
    """Where it is cut off; mean, standard deviation and what remains of it before it is cut.

    Itself it has mean 0 and variance 1.
    """
    at = skew / _SKEW_STEP
    if skew < LEAST_SKEW:
        return -FAR, 0.0, 1.0, 1.0
    i = min(int(at), len(_OF_SKEW) - 2)
    low, high, part = _OF_SKEW[i], _OF_SKEW[i + 1], min(at - i, 1.0)
    end = low[0] + part * (high[0] - low[0])
    mean = low[1] + part * (high[1] - low[1])
    wide = low[2] + part * (high[2] - low[2])
    return end, mean, wide, below((mean - end) / wide)


@kernel(inline=True)
def between_cut(
    low: float, high: float, cut: tuple[float, float, float, float]
) -> tuple[float, float, float]:
    """The same as `between`, of a normal that is cut off and has mean 0 and variance 1 then."""
    end, mean, wide, whole = cut
    low = max(low, end)
    if high <= low:
        return 0.0, 0.0, 1.0
    likely, at, left = between((low - mean) / wide, (high - mean) / wide)
    return likely / whole, mean + wide * at, left * wide * wide
