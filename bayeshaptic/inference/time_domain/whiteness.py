"""When a series passes for white noise."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Floats

LAGS = 20  # samples
FEWEST = 300  # samples that show whether a series is white
_RARE = 1e-3  # how often a test tells chance from white noise


def correlated(series: Floats) -> float:
    """Sum of squared correlations of `LAGS` lags, each over what its own products vary by.

    So their sizes may differ, as where a mass rests, and zeros count for nothing (R. S. Deo,
    Journal of Econometrics 99, 2000, of the test of G. E. P. Box and D. A. Pierce).
    """
    products = (series[k:] * series[:-k] for k in range(1, LAGS + 1))
    return float(sum(np.sum(one) ** 2 / np.maximum(one @ one, 1e-300) for one in products))


def by_chance(freedom: int) -> float:
    """What a statistic of so many degrees of freedom exceeds by chance, rarely."""
    from scipy.stats import chi2

    return float(chi2.isf(_RARE, freedom))
