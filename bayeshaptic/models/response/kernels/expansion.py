"""Polynomials as `rational.py` reads them, and the expansion of their ratio for large s."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats


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
    order = series.shape[1]
    scale = (1.0 / period_s) ** np.arange(denominator.shape[1])
    above, below = np.empty(numerator.shape[1]), np.empty(denominator.shape[1])
    for row in range(len(numerator)):
        degree = len(below) - 1
        while degree > 0 and denominator[row, degree] == 0.0:
            degree -= 1
        lead = 1.0 / (denominator[row, degree] * scale[degree])
        for power in range(len(below)):
            below[power] = denominator[row, power] * scale[power] * lead
        for power in range(len(above)):
            above[power] = numerator[row, power] * scale[power] * lead
        _split(above, top[row])
        _split(below, bottom[row])
        h = series[row]
        start = -1
        for q in range(order):
            value = above[degree - q] if 0 <= degree - q < len(above) else 0.0
            for back in range(min(q, degree), 0, -1):  # the newest last: it is waited for
                value -= below[degree - back] * h[q - back]
            h[q] = value
            if start < 0 and value != 0.0:
                start = q
        if start < 0:
            fastest[row] = np.inf
            continue
        first, last = max(abs(h[start]), abs(h[start + 1])), 0.0
        for q in range(order - 4, order):
            last = max(last, abs(h[q]))
        fastest[row] = (last / first) ** (1.0 / (order - 3 - start))


@kernel(inline=True)
def _split(coefficients: Floats, out: Floats) -> None:
    """Coefficients of Re and of Im/theta of a polynomial in j theta, in powers of z; (2, n)."""
    out[:] = 0.0
    for power in range(len(coefficients)):
        sign = -1.0 if power % 4 >= 2 else 1.0
        out[power % 2, power // 2] = sign * coefficients[power]
