"""The compiled parts of `../remainder.py` and `../aliases.py`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.compiled import kernel
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.types import Floats


@kernel(inline=True)
def _polynomial(
    coefficients: Floats, omega: Floats, minus: Floats, real: Floats, imaginary: Floats
) -> None:
    """Values at j omega, with minus its square, of polynomials (degree + 1, B); all else (B,)."""
    degree, batch = coefficients.shape[0] - 1, coefficients.shape[1]
    last_even, last_odd = degree - degree % 2, degree - (degree + 1) % 2
    for b in range(batch):
        real[b] = coefficients[last_even, b]
        imaginary[b] = coefficients[last_odd, b] if degree > 0 else 0.0
    for power in range(last_even - 2, -1, -2):
        for b in range(batch):
            real[b] = real[b] * minus[b] + coefficients[power, b]
    for power in range(last_odd - 2, 0, -2):
        for b in range(batch):
            imaginary[b] = imaginary[b] * minus[b] + coefficients[power, b]
    for b in range(batch):
        imaginary[b] *= omega[b]


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
    omega : ndarray, shape (L, B)
    denominator, mutual, own : ndarray, shape (degree + 1, B)
    stiffness : ndarray, shape (L, B, 2)
        Real and imaginary part of lambda.
    out : ndarray, shape (L, B, 2)
    """
    batch = denominator.shape[1]
    values, minus = np.empty((6, batch)), np.empty(batch)
    for line in range(len(omega)):
        for b in range(batch):
            minus[b] = -omega[line, b] * omega[line, b]
        _polynomial(denominator, omega[line], minus, values[0], values[1])
        _polynomial(mutual, omega[line], minus, values[2], values[3])
        _polynomial(own, omega[line], minus, values[4], values[5])
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
            size = 1.0 / (omega[line, b] * (below * below + below_j * below_j))
            out[line, b, 0] = size * (above * below_j - above_j * below)
            out[line, b, 1] = size * (above * below + above_j * below_j)


@kernel
def return_difference(
    omega: Floats, denominator: Floats, own: Floats, stiffness: Floats, out: Floats
) -> None:
    """1 + lambda h / d, the arguments those of `add_link`."""
    batch = denominator.shape[1]
    values, minus = np.empty((4, batch)), np.empty(batch)
    for line in range(len(omega)):
        for b in range(batch):
            minus[b] = -omega[line, b] * omega[line, b]
        _polynomial(denominator, omega[line], minus, values[0], values[1])
        _polynomial(own, omega[line], minus, values[2], values[3])
        for b in range(batch):
            d, dj, h, hj = values[0, b], values[1, b], values[2, b], values[3, b]
            size = 1.0 / (d * d + dj * dj)
            ratio, ratio_j = size * (h * d + hj * dj), size * (hj * d - h * dj)
            k, kj = stiffness[line, b, 0], stiffness[line, b, 1]
            out[line, b, 0] = 1.0 + k * ratio - kj * ratio_j
            out[line, b, 1] = k * ratio_j + kj * ratio


@kernel
def add_links(
    omega: Floats,
    denominator: Floats,
    numerators: Floats,
    stiffness: NDArray[np.complex128],
    total: NDArray[np.complex128],
    difference: NDArray[np.complex128],
) -> None:
    """Several links, one after the other: what they add over j omega, and 1 + lambda h / d of all.

    Parameters
    ----------
    omega : ndarray, shape (L, B)
    denominator : ndarray, shape (degree + 1, B)
    numerators : ndarray, shape (pairs, degree + 1, B)
        Of the compliances between drive (0) and links (from 1 on): 01, 11, 02, 12, 22, 03, ...
    stiffness : ndarray, shape (links, L, B)
    total, difference : ndarray, shape (L, B)
        Become the results.
    """
    links, batch = stiffness.shape[0], denominator.shape[1]
    values, below = np.empty((len(numerators), 2, batch)), np.empty((2, batch))
    minus = np.empty(batch)
    h = np.empty((links + 1, links + 1), np.complex128)
    for line in range(len(omega)):
        for b in range(batch):
            minus[b] = -omega[line, b] * omega[line, b]
        _polynomial(denominator, omega[line], minus, below[0], below[1])
        for pair in range(len(numerators)):
            _polynomial(numerators[pair], omega[line], minus, values[pair, 0], values[pair, 1])
        for b in range(batch):
            inverse = 1.0 / complex(below[0, b], below[1, b])
            pair = 0
            for j in range(1, links + 1):
                for i in range(j + 1):
                    h[i, j] = h[j, i] = complex(values[pair, 0, b], values[pair, 1, b]) * inverse
                    pair += 1
            added, product = complex(0.0, 0.0), complex(1.0, 0.0)
            for link in range(1, links + 1):
                pivot = 1.0 + stiffness[link - 1, line, b] * h[link, link]
                product *= pivot
                gain = stiffness[link - 1, line, b] / pivot
                added -= gain * h[0, link] * h[0, link]
                for j in range(link + 1, links + 1):
                    h[0, j] -= gain * h[0, link] * h[link, j]
                    for i in range(link + 1, j + 1):
                        h[i, j] -= gain * h[link, i] * h[link, j]
                        h[j, i] = h[i, j]
            total[line, b] = added / complex(0.0, omega[line, b])
            difference[line, b] = product


@kernel
def sampled(
    theta: Floats, series: Floats, top: float, turns: Floats, period_s: float, values: Floats
) -> None:
    """`values` with their aliases, behind hold and delay, each loop at its own angles.

    Parameters
    ----------
    theta : ndarray, shape (L, B)
        Angles w T.
    series : ndarray, shape (terms, B, 2)
        Chebyshev series of the aliases up to the angle `top`.
    turns : ndarray, shape (B,)
        Delay in periods.
    values : ndarray, shape (L, B, 2)
        Over s; becomes the product.
    """
    terms, batch, _ = series.shape
    for line in range(len(theta)):
        for b in range(batch):
            twice = 4.0 * theta[line, b] / top - 2.0
            re = im = last = last_j = 0.0
            for term in range(terms - 1, 0, -1):
                re, last = series[term, b, 0] + twice * re - last, re
                im, last_j = series[term, b, 1] + twice * im - last_j, im
            re = values[line, b, 0] + series[0, b, 0] + 0.5 * twice * re - last
            im = values[line, b, 1] + series[0, b, 1] + 0.5 * twice * im - last_j
            cosine, sine = cos_sin(0.5 * theta[line, b])
            c, s = cos_sin(theta[line, b] * turns[b])
            size = 2.0 * sine / period_s
            hold, hold_j = size * (sine * c + cosine * s), size * (cosine * c - sine * s)
            values[line, b, 0] = hold * re - hold_j * im
            values[line, b, 1] = hold * im + hold_j * re


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
