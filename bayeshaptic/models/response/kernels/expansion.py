"""Polynomials as `rational.py` reads them, and the expansion of their ratio for large s."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats

_LANES = 16  # rows whose divisions are vector instructions


@kernel
def expand(
    numerator: Floats,
    denominator: Floats,
    period_s: float,
    top: Floats,
    bottom: Floats,
    series: Floats,
    fastest: Floats,
) -> None:
    """The polynomials in powers of sT, split; and their ratio in powers of 1/s.

    `fastest` becomes |p_max| T: h_q T^q grows like its q-th power, so that its last terms tell it.
    """
    batch, order, most = len(numerator), series.shape[1], denominator.shape[1] - 1
    scale = (1.0 / period_s) ** np.arange(most + 1)
    above, below = np.empty(numerator.shape[1]), np.empty(most + 1)
    backwards, h = np.empty((most + 1, _LANES)), np.empty((order + most, _LANES))
    for first in range(0, batch, _LANES):
        backwards[:], h[:] = 0.0, 0.0
        for row in range(first, min(first + _LANES, batch)):
            degree = most
            while degree > 0 and denominator[row, degree] == 0.0:
                degree -= 1
            lead = 1.0 / (denominator[row, degree] * scale[degree])
            for power in range(most + 1):
                below[power] = denominator[row, power] * scale[power] * lead
            for power in range(len(above)):
                above[power] = numerator[row, power] * scale[power] * lead
            _split(above, top[row])
            _split(below, bottom[row])
            for power in range(min(degree + 1, len(above))):
                h[degree - power, row - first] = above[power]
            for power in range(degree):
                backwards[degree - power, row - first] = below[power]
        _divide(backwards, h, order)
        for row in range(first, min(first + _LANES, batch)):
            for q in range(order):
                series[row, q] = h[q, row - first]
            fastest[row] = _growth(series[row])


@kernel(inline=True)
def _divide(backwards: Floats, h: Floats, order: int) -> None:
    """Long division of some rows at a time, which would wait for one number after the other.

    `h` becomes the quotient from the numerator, highest power first.
    """
    for q in range(order):
        for back in range(1, len(backwards)):
            for lane in range(h.shape[1]):
                h[q + back, lane] -= backwards[back, lane] * h[q, lane]


@kernel(inline=True)
def _growth(h: Floats) -> float:
    """By which factor h_q T^q grows from term to term; inf where there is none."""
    order, start = len(h), 0
    while start < order and h[start] == 0.0:
        start += 1
    if start == order:
        return np.inf
    first, last = max(abs(h[start]), abs(h[start + 1])), 0.0
    for q in range(order - 4, order):
        last = max(last, abs(h[q]))
    return (last / first) ** (1.0 / (order - 3 - start))


@kernel(inline=True)
def _split(coefficients: Floats, out: Floats) -> None:
    """Coefficients of Re and of Im/theta of a polynomial in j theta, in powers of z; (2, n)."""
    out[:] = 0.0
    for power in range(len(coefficients)):
        sign = -1.0 if power % 4 >= 2 else 1.0
        out[power % 2, power // 2] = sign * coefficients[power]
