"""When a series passes for white noise."""

from __future__ import annotations

LAGS = 20  # samples
FEWEST = 300  # samples that show whether a series is white
_RARE = 1e-3  # how often a test tells chance from white noise


def by_chance(freedom: int) -> float:
    """What a statistic of so many degrees of freedom exceeds by chance, rarely."""
    from scipy.stats import chi2

    return float(chi2.isf(_RARE, freedom))
