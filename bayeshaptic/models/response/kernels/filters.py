r"""Filters behind a mechanism, and poles in the closed form, compiled; a vector at a time.

Filters that are too fast for the series over aliases are parted from it by partial fractions at
their poles q_j: with mechanism N/D and filters M/F,

.. math:: \frac{N M}{D F} = \sum_j \frac{c_j}{s - q_j} + \frac{R}{D}, \qquad
          c_j = \frac{N(q_j) M(q_j)}{D(q_j) F'(q_j)}, \qquad R = \frac{N M - D C}{F},

C the numerator of the sum over j.  The poles have the closed form, and R/D has no poles but the
mechanism's.  The division for R begins at the lowest power, where F is 1 + small terms.
`tests/references/plain_response.py` is the same in plain NumPy.  It contains `held_pole.py` beside
it, and is to be compiled anew where that is changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.models.response.kernels.held_pole import held_pole
from bayeshaptic.types import Complexes, Floats, Ints

_FAST = 1.0  # |q| T from which on the series over aliases does not bear a filter
_NEAR, _EPS = 0.25, 2.0**-52
# Radians a sample that two poles at zero are moved by, of a mass without damper.  The relative
# error is (this / theta)^2 and some ten eps / this: below 1e-7 from 1/20000 of the sampling rate.
_SLOW = 1e-7


@kernel(inline=True)
def _product(a: Floats, factors: Floats, lengths: Ints, row: int, out: Floats) -> int:
    """`a` times all factors, (F, n, B); how many coefficients that has."""
    count = len(a)
    out[:] = 0.0
    out[:count] = a
    for f in range(len(lengths)):
        for power in range(count + lengths[f] - 2, -1, -1):
            value = 0.0
            for k in range(max(0, power - count + 1), min(power, lengths[f] - 1) + 1):
                value += factors[f, k, row] * out[power - k]
            out[power] = value
        count += lengths[f] - 1
    return count


@kernel(inline=True)
def _at(c: Floats, count: int, s: complex) -> complex:
    value = complex(0.0, 0.0)
    for power in range(count - 1, -1, -1):
        value = value * s + c[power]
    return value


@kernel(inline=True)
def _over(a: complex, b: complex) -> complex:
    """A quotient that is no number where the divisor is zero, and no error."""
    size = 1.0 / (b.real * b.real + b.imag * b.imag)
    real = (a.real * b.real + a.imag * b.imag) * size
    return complex(real, (a.imag * b.real - a.real * b.imag) * size)


@kernel(inline=True)
def _move_apart(q: Complexes, least: float, out: Complexes) -> None:
    """As `numerics.polynomials.partial_fractions.moved_apart`."""
    for i in range(len(q)):
        size = abs(q[i])
        before, others = 0, 0
        for j in range(len(q)):
            if j != i and abs(q[i] - q[j]) < max(_NEAR * _EPS ** (1 / 3) * size, least):
                others += 1
                before += 1 if j < i else 0
        h = max(_NEAR * _EPS ** (1 / (others + 2)) * size, least)
        out[i] = q[i] + complex(0.0, 2.0 * (before - 0.5 * others) * h)


@kernel(inline=True)
def _add_up(q: Complexes, parts: Complexes, lead: float, term: Complexes, out: Floats) -> None:
    """Numerator of the sum of partial fractions over a denominator with this leading factor."""
    out[:] = 0.0
    for j in range(len(q)):
        term[:] = 0.0
        term[0] = parts[j] * lead
        length = 1
        for i in range(len(q)):
            if i != j:
                term[length] = term[length - 1]
                for power in range(length - 1, 0, -1):
                    term[power] = term[power - 1] - q[i] * term[power]
                term[0] = -q[i] * term[0]
                length += 1
        for power in range(length):
            out[power] += term[power].real


@kernel(inline=True)
def _close(p: complex, r: complex, turns: float, out: Floats) -> None:
    """Numerators without and with a further z^-1, and the centre, (3, 2)."""
    direct, second, centre = held_pole(p, r, turns - math.floor(turns))
    out[0, 0], out[0, 1] = direct.real, direct.imag
    out[1, 0], out[1, 1] = second.real, second.imag
    out[2, 0], out[2, 1] = centre.real, centre.imag


@kernel
def close(
    top: Floats, lead: Floats, poles: Complexes, turns: Floats, period_s: float, out: Floats
) -> None:
    """The closed form of whole responses.

    Parameters
    ----------
    top : ndarray, shape (R, m)
        Numerators.
    lead : ndarray, shape (R,)
        Leading coefficients of the denominators.
    poles : ndarray of complex, shape (R, n)
    turns : ndarray, shape (R,)
        Delay in periods.
    out : ndarray, shape (R, n, 3, 2)
        Becomes the table of the poles.
    """
    count = poles.shape[1]
    q = np.empty(count, np.complex128)
    for row in range(len(poles)):
        _move_apart(poles[row], _SLOW / period_s, q)
        for j in range(count):
            gaps = complex(lead[row], 0.0)
            for i in range(count):
                if i != j:
                    gaps *= q[j] - q[i]
            part = _over(_at(top[row], top.shape[1], q[j]), gaps)
            _close(q[j] * period_s, part * period_s, turns[row], out[row, j])


@kernel
def part(
    top: Floats,
    bottom: Floats,
    tops: Floats,
    bottoms: Floats,
    lengths: Ints,
    own: Complexes,
    turns: Floats,
    period_s: float,
    out_top: Floats,
    out_bottom: Floats,
    count: Ints,
    terms: Floats,
) -> None:
    """Put filters behind mechanisms N/D, or part them from those.

    Parameters
    ----------
    top, bottom : ndarray, shape (B, n)
        Of the mechanism.
    tops, bottoms : ndarray, shape (F, n, B)
        Of the filters.
    lengths : ndarray of int, shape (2, F)
        How many coefficients these have.
    own : ndarray of complex, shape (B, P)
        The filters' poles.
    turns : ndarray, shape (B,)
        Delay in periods.
    out_top, out_bottom : ndarray, shape (B, n)
        What is left for the series; become so.
    count, terms : ndarray, shape (B,) and (B, P, 3, 2)
        How many poles are to be added in the closed form, and these.
    """
    size, width, poles = bottom.shape[1], out_bottom.shape[1], own.shape[1]
    one = np.ones(1)
    whole, factor = np.empty(max(out_top.shape[1], width)), np.empty(width)
    q, parts = np.empty(poles, np.complex128), np.empty(poles, np.complex128)
    term, total = np.empty(poles + 1, np.complex128), np.empty(poles + 1)
    for row in range(len(top)):
        fast = False
        for pole in range(poles):
            fast |= abs(own[row, pole]) * period_s > _FAST
        above = _product(top[row], tops, lengths[0], row, whole)
        if not fast:
            out_top[row] = whole[: out_top.shape[1]]
            _product(bottom[row], bottoms, lengths[1], row, out_bottom[row])
            count[row] = 0
            continue
        below = _product(one, bottoms, lengths[1], row, factor)
        _move_apart(own[row], 0.0, q)
        for j in range(poles):
            gaps = complex(factor[below - 1], 0.0)
            for i in range(poles):
                if i != j:
                    gaps *= q[j] - q[i]
            parts[j] = _over(_over(_at(whole, above, q[j]), gaps), _at(bottom[row], size, q[j]))
            _close(q[j] * period_s, parts[j] * period_s, turns[row], terms[row, j])
        _add_up(q, parts, factor[below - 1], term, total)
        out_top[row] = 0.0
        for k in range(size - 1):  # R, its lowest power first
            value = whole[k] if k < above else 0.0
            for j in range(min(k, poles - 1) + 1):
                value -= total[j] * bottom[row, k - j]
            for j in range(1, min(k, below - 1) + 1):
                value -= factor[j] * out_top[row, k - j]
            out_top[row, k] = value / factor[0]
        out_bottom[row] = 0.0
        out_bottom[row, :size] = bottom[row]
        count[row] = poles
