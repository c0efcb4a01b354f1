"""The compiled part of `../rational.py`, with the formulas of `../alias_tables.py`.

Some rows of the batch at a time, which have one delay: their responses at all nodes are made in a
few small arrays, and written out or put into the windows of a likelihood.  A function that is given
tuples of arrays counts references to each of them, which takes as long as a third of a row: so the
loops over rows are within these functions.

Polynomials at s = j w are split into even and odd powers, which are real: with z = theta^2, the
even ones in z, the odd ones theta times a polynomial in z.  Loops over the nodes read and write few
arrays, so that the compiler makes vector instructions of them.

It contains `alias_series.py` beside it, and is to be compiled anew where that is changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.models.response.kernels.alias_series import alias_matrix, combine, economise
from bayeshaptic.models.response.kernels.arrays import RationalArrays, Space
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.types import Floats

TOGETHER = 4  # rows whose responses stay in the nearest cache


@kernel(inline=True)
def rows_from(first: int, form: RationalArrays) -> int:
    """Where the rows end that are taken together with this one.

    They have its delay, and are by their poles alone where it is.
    """
    turns, alone, last = form.turns, form.pole_count[first] < 0, first + 1
    while last < len(turns) and last - first < TOGETHER and turns[last] == turns[first]:
        if (form.pole_count[last] < 0) != alone:
            break
        last += 1
    return last


@kernel(inline=True)
def space_of(form: RationalArrays) -> Space:
    """Arrays for `respond_together`."""
    nodes, terms = len(form.theta), len(form.binomials)
    powers = 2 * form.binomials.shape[2]
    return Space(
        np.empty((terms, powers)),
        np.empty((terms, powers)),
        np.empty((TOGETHER, powers)),
        np.empty((TOGETHER, powers)),
        np.empty((2, nodes)),
        np.zeros((4, nodes)),
        np.empty((2, nodes)),
        np.empty((TOGETHER, 2, nodes)),
        np.full(1, np.nan),
    )


@kernel(inline=True)
def respond_together(form: RationalArrays, first: int, last: int, space: Space) -> None:
    """The responses of the rows of `rows_from`, in `space.response`.

    The tables of a delay stay in `space` for the rows that follow.
    """
    turns = form.turns[first]
    late = turns - math.floor(turns)
    if form.pole_count[first] < 0:  # their poles are all there is
        for row in range(first, last):
            space.response[row - first] = 0.0
            _add_poles(form, row, space, space.response[row - first])
        return
    if turns != space.turns[0]:
        space.turns[0] = turns
        alias_matrix(late, False, form.bernoulli, form.binomials, space.matrix)
        if len(form.high):
            alias_matrix(late, True, form.bernoulli, form.binomials, space.far_matrix)
        _delay(turns, form.theta, form.hold, space.factor[0], space.factor[1])
    combine(space.matrix, form.series, first, last, space.tail)
    economise(space.tail, form.economy, last - first)
    _add_up(form, first, last, space)
    if len(form.high):
        combine(space.far_matrix, form.series, first, last, space.far_tail)
        _towards_nyquist(form, first, last, late, space)
    for row in range(first, last):
        if form.pole_count[row] != 0:
            _add_poles(form, row, space, space.response[row - first])


@kernel(inline=True)
def _begin(coefficients: Floats, row: int, theta: Floats, out: Floats) -> None:
    """Horner's scheme for both parts of a polynomial, as far as their four lowest coefficients.

    Nothing is done where there are no more than those.
    """
    for part in range(2):
        for group in range(coefficients.shape[2] // 4 - 1, 0, -1):
            c0, c1 = coefficients[row, part, 4 * group], coefficients[row, part, 4 * group + 1]
            c2, c3 = coefficients[row, part, 4 * group + 2], coefficients[row, part, 4 * group + 3]
            top = 4 * group + 4 == coefficients.shape[2]
            for node in range(len(theta)):
                z = theta[node] * theta[node]
                before = 0.0 if top else out[part, node]
                out[part, node] = (((before * z + c3) * z + c2) * z + c1) * z + c0


@kernel(inline=True)
def _add_up(form: RationalArrays, first: int, last: int, space: Space) -> None:
    """Numerator over denominator and the alias series, behind hold and delay."""
    theta, factor, out, begun = form.theta, space.factor, space.response, space.begun
    numerator, denominator, tail = form.numerator, form.denominator, space.tail
    half = tail.shape[1] // 2
    for row in range(first, last):
        _begin(numerator, row, theta, begun[:2])
        _begin(denominator, row, theta, begun[2:])
        real, imag = out[row - first, 0], out[row - first, 1]
        _ten(tail[row - first, :half], theta, real)
        _ten(tail[row - first, half:], theta, imag)
        _finish(numerator[row], denominator[row], begun, theta, factor, real, imag)


@kernel(inline=True)
def _finish(
    top: Floats,
    bottom: Floats,
    begun: Floats,
    theta: Floats,
    factor: Floats,
    real: Floats,
    imag: Floats,
) -> None:
    """Numerator over denominator, by their four lowest powers and what has begun above these.

    Added to the alias series, and all that behind hold and delay.
    """
    a0, a1, a2, a3 = top[0, 0], top[0, 1], top[0, 2], top[0, 3]
    b0, b1, b2, b3 = top[1, 0], top[1, 1], top[1, 2], top[1, 3]
    c0, c1, c2, c3 = bottom[0, 0], bottom[0, 1], bottom[0, 2], bottom[0, 3]
    d0, d1, d2, d3 = bottom[1, 0], bottom[1, 1], bottom[1, 2], bottom[1, 3]
    a, b, c, d = begun[0], begun[1], begun[2], begun[3]
    factor_re, factor_im = factor[0], factor[1]
    for node in range(len(theta)):
        x = theta[node]
        z = x * x
        ne = (((a[node] * z + a3) * z + a2) * z + a1) * z + a0
        no = (((b[node] * z + b3) * z + b2) * z + b1) * z + b0
        de = (((c[node] * z + c3) * z + c2) * z + c1) * z + c0
        do = (((d[node] * z + d3) * z + d2) * z + d1) * z + d0
        size = 1.0 / (x * (de * de + z * do * do))
        re = x * size * (no * de - ne * do) + real[node]
        im = x * imag[node] - size * (ne * de + z * no * do)
        real[node] = re * factor_re[node] - im * factor_im[node]
        imag[node] = re * factor_im[node] + im * factor_re[node]


@kernel(inline=True)
def _ten(c: Floats, theta: Floats, out: Floats) -> None:
    """A polynomial in z with ten coefficients, at all nodes."""
    c0, c1, c2, c3, c4 = c[0], c[1], c[2], c[3], c[4]
    c5, c6, c7, c8, c9 = c[5], c[6], c[7], c[8], c[9]
    for node in range(len(theta)):
        z = theta[node] * theta[node]
        value = (((((c9 * z + c8) * z + c7) * z + c6) * z + c5) * z + c4) * z + c3
        out[node] = ((value * z + c2) * z + c1) * z + c0


@kernel(inline=True)
def _towards_nyquist(
    form: RationalArrays, first: int, last: int, late: float, space: Space
) -> None:
    """Responses at the high nodes, where the nearest aliases are taken by themselves."""
    factor, out = space.factor, space.response
    for row in range(first, last):
        top, bottom, tail = form.numerator[row], form.denominator[row], space.far_tail[row - first]
        for i in range(len(form.high)):
            node = form.high[i]
            value = _near_nyquist(top, bottom, tail, late, form.theta[node])
            value *= complex(factor[0, node], factor[1, node])
            out[row - first, 0, node], out[row - first, 1, node] = value.real, value.imag


@kernel(inline=True)
def _at(even: Floats, odd: Floats, theta: float) -> complex:
    """A split polynomial at one node."""
    z, re, im = theta * theta, 0.0, 0.0
    for power in range(len(even) - 1, -1, -1):
        re = re * z + even[power]
        im = im * z + odd[power]
    return complex(re, theta * im)


@kernel(inline=True)
def _near_nyquist(top: Floats, bottom: Floats, tail: Floats, late: float, theta: float) -> complex:
    """The sum over aliases, the nearest ones as they stand."""
    half = len(tail) // 2
    total = _at(tail[:half], tail[half:], theta)
    for k in range(-1, 2):
        x = theta + 2 * math.pi * k
        turn = complex(math.cos(2 * math.pi * k * late), -math.sin(2 * math.pi * k * late))
        total += turn * _at(top[0], top[1], x) / (_at(bottom[0], bottom[1], x) * complex(0.0, x))
    return total


@kernel(inline=True)
def _delay(turns: float, theta: Floats, hold: Floats, out_re: Floats, out_im: Floats) -> None:
    """Hold and delay of so many periods at all nodes."""
    hold_re, hold_im = hold[0], hold[1]
    for node in range(len(theta)):
        c, s = cos_sin(theta[node] * turns)
        out_re[node] = hold_re[node] * c + hold_im[node] * s
        out_im[node] = hold_im[node] * c - hold_re[node] * s


@kernel(inline=True)
def _add_poles(form: RationalArrays, row: int, space: Space, response: Floats) -> None:
    """Add the closed form of a row's poles."""
    re, im, real, imag = space.poles[0], space.poles[1], response[0], response[1]
    hold_re, hold_im = form.hold[0], form.hold[1]
    re[:], im[:] = 0.0, 0.0
    for pole in range(abs(form.pole_count[row])):
        table = form.poles[row, pole]
        direct_re, direct_im = table[0, 0], table[0, 1]
        late_re, late_im = table[1, 0], table[1, 1]
        centre_re, centre_im = table[2, 0], table[2, 1]
        for node in range(len(re)):
            above_re = direct_re + late_re * (1 - hold_re[node]) + late_im * hold_im[node]
            above_im = direct_im + late_im * (1 - hold_re[node]) - late_re * hold_im[node]
            below_re, below_im = -hold_re[node] - centre_re, hold_im[node] - centre_im
            size = 1.0 / (below_re * below_re + below_im * below_im)
            re[node] += size * (above_re * below_re + above_im * below_im)
            im[node] += size * (above_im * below_re - above_re * below_im)
    whole = math.floor(form.turns[row])
    for node in range(len(re)):
        c, s = cos_sin(form.theta[node] * whole)
        real[node] += re[node] * c + im[node] * s
        imag[node] += im[node] * c - re[node] * s


@kernel
def respond(form: RationalArrays, out: Floats) -> None:
    """The response of every row; `out` is (B, 2, L), real and imaginary part."""
    space = space_of(form)
    first = 0
    while first < len(out):
        last = rows_from(first, form)
        respond_together(form, first, last, space)
        for row in range(first, last):
            for node in range(len(form.theta)):
                out[row, 0, node] = space.response[row - first, 0, node]
                out[row, 1, node] = space.response[row - first, 1, node]
        first = last
