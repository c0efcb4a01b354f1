"""The compiled part of `../remainder.py`."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.types import Floats


@kernel(inline=True)
def _polynomial(coefficients: Floats, omega: float, real: Floats, imaginary: Floats) -> None:
    """Values at j omega of polynomials of shape (degree + 1, B), into arrays of shape (B,)."""
    degree, batch = coefficients.shape[0] - 1, coefficients.shape[1]
    square = -omega * omega
    last_even, last_odd = degree - degree % 2, degree - (degree + 1) % 2
    for b in range(batch):
        real[b] = coefficients[last_even, b]
        imaginary[b] = coefficients[last_odd, b] if degree > 0 else 0.0
    for power in range(last_even - 2, -1, -2):
        for b in range(batch):
            real[b] = real[b] * square + coefficients[power, b]
    for power in range(last_odd - 2, 0, -2):
        for b in range(batch):
            imaginary[b] = imaginary[b] * square + coefficients[power, b]
    for b in range(batch):
        imaginary[b] *= omega


@kernel
def add_link(
    omega: Floats,
    denominator: Floats,
    mutual: Floats,
    own: Floats,
    stiffness: Floats,
    out: Floats,
) -> None:
    """-lambda m^2 / (d (d + lambda h)) / (j omega) of one link, m, h and d polynomials there.

    Parameters
    ----------
    omega : ndarray, shape (L,)
    denominator, mutual, own : ndarray, shape (degree + 1, B)
    stiffness : ndarray, shape (L, B, 2)
        Real and imaginary part of lambda.
    out : ndarray, shape (L, B, 2)
    """
    batch = denominator.shape[1]
    values = np.empty((6, batch))
    for line in range(len(omega)):
        _polynomial(denominator, omega[line], values[0], values[1])
        _polynomial(mutual, omega[line], values[2], values[3])
        _polynomial(own, omega[line], values[4], values[5])
        for b in range(batch):
            d, dj, m, mj = values[0, b], values[1, b], values[2, b], values[3, b]
            k, kj = stiffness[line, b, 0], stiffness[line, b, 1]
            with_link = d + k * values[4, b] - kj * values[5, b]
            with_link_j = dj + k * values[5, b] + kj * values[4, b]
            below = d * with_link - dj * with_link_j
            below_j = d * with_link_j + dj * with_link
            square, square_j = m * m - mj * mj, 2.0 * m * mj
            above = k * square - kj * square_j
            above_j = k * square_j + kj * square
            size = 1.0 / (omega[line] * (below * below + below_j * below_j))
            out[line, b, 0] = size * (above * below_j - above_j * below)
            out[line, b, 1] = size * (above * below + above_j * below_j)


@kernel
def hold_and_delay(theta: Floats, hold: Floats, turns: Floats, total: Floats, out: Floats) -> None:
    """`total` behind hold and delay.

    Parameters
    ----------
    theta : ndarray, shape (L,)
        Angles w T.
    hold : ndarray, shape (L, 2)
    turns : ndarray, shape (B,)
        Delay in periods.
    total : ndarray, shape (L, B, 2)
    out : ndarray, shape (B, L, 2)
        Becomes the product.
    """
    c, s = np.empty(len(theta)), np.empty(len(theta))
    for b in range(len(turns)):
        if b == 0 or turns[b] != turns[b - 1]:
            for line in range(len(theta)):
                cosine, sine = cos_sin(theta[line] * turns[b])
                c[line] = hold[line, 0] * cosine + hold[line, 1] * sine
                s[line] = hold[line, 1] * cosine - hold[line, 0] * sine
        for line in range(len(theta)):
            re, im = total[line, b, 0], total[line, b, 1]
            out[b, line, 0] = c[line] * re - s[line] * im
            out[b, line, 1] = c[line] * im + s[line] * re
