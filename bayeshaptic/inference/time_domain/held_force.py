"""The exact motion of a mass and a viscous damper under a force that is held.

`kernels.py` beside it contains `integrated`, and is to be compiled anew where that is changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.types import Floats


def integrated(rate: float, span_s: float) -> tuple[float, float, float]:
    """What is kept of a velocity that fades at a rate, and its integrals, once and twice."""
    slight = 1e-6  # of a velocity, lost in the time: a series then is exact
    if rate * span_s > slight:
        kept = math.exp(-rate * span_s)
        once = (1 - kept) / rate
        return kept, once, (span_s - once) / rate
    return 1 - rate * span_s, span_s * (1 - 0.5 * rate * span_s), 0.5 * span_s * span_s


def over_span(mass: float, damping: float, span_s: float) -> tuple[Floats, Floats]:
    """Position and velocity `span_s` later, (2, 2), and what a held unit force adds, (2,)."""
    kept, once, twice = integrated(damping / mass, span_s)
    return np.array([[1.0, once], [0.0, kept]]), np.array([twice, once]) / mass


def position_over_command(
    mass: float, damping: float, delay_s: float, period_s: float
) -> tuple[Floats, Floats]:
    """Position over a command, held and late: numerator and denominator in powers of 1/z."""
    whole = math.floor(delay_s / period_s)
    late_s = delay_s - whole * period_s
    motion, _ = over_span(mass, damping, period_s)
    after, now = over_span(mass, damping, period_s - late_s)
    _, before = over_span(mass, damping, late_s)
    far, kept = motion[0, 1], motion[1, 1]
    above = np.zeros(whole + 4)
    for first, (moved, faster) in ((whole, now), (whole + 1, after @ before)):
        above[first + 1] += moved
        above[first + 2] += far * faster - kept * moved
    return above, np.array([1.0, -1.0 - kept, kept])
