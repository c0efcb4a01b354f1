"""The compiled part of `../rational.py`, with the formulas of `../sampled.py`.

One row of the batch at a time: its response at all nodes is made in a few small arrays, and used
there, written out or put into the windows of a likelihood.

Polynomials at s = j w are split into even and odd powers, which are real: with z = theta^2, the
even ones in z, the odd ones theta times a polynomial in z.  Loops over the nodes read and write few
arrays, so that the compiler makes vector instructions of them.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.models.response.kernels.arrays import RationalArrays, Space, WindowArrays
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.numerics.weighted_logs import weighted_logs
from bayeshaptic.types import Floats


@kernel(inline=True)
def _values(c: Floats, theta: Floats, out: Floats) -> None:
    """A polynomial in z with 4 n coefficients, at all nodes."""
    for group in range(len(c) // 4 - 1, -1, -1):
        c0, c1, c2, c3 = c[4 * group], c[4 * group + 1], c[4 * group + 2], c[4 * group + 3]
        if 4 * group + 4 == len(c):
            for node in range(len(theta)):
                z = theta[node] * theta[node]
                out[node] = ((c3 * z + c2) * z + c1) * z + c0
        else:
            for node in range(len(theta)):
                z = theta[node] * theta[node]
                out[node] = (((out[node] * z + c3) * z + c2) * z + c1) * z + c0


@kernel(inline=True)
def _long(c: Floats, theta: Floats, out: Floats) -> None:
    """A polynomial in z with 14 coefficients, at all nodes."""
    c0, c1, c2, c3, c4, c5, c6 = c[0], c[1], c[2], c[3], c[4], c[5], c[6]
    d0, d1, d2, d3, d4, d5, d6 = c[7], c[8], c[9], c[10], c[11], c[12], c[13]
    for node in range(len(theta)):
        z = theta[node] * theta[node]
        value = (((((d6 * z + d5) * z + d4) * z + d3) * z + d2) * z + d1) * z + d0
        value = (((value * z + c6) * z + c5) * z + c4) * z + c3
        out[node] = ((value * z + c2) * z + c1) * z + c0


@kernel(inline=True)
def _alias_matrix(
    late: float, far: bool, bernoulli: Floats, binomials: Floats, out: Floats
) -> None:
    """From h_q T^q to the coefficients A_p, split, for a delay of `late` periods; (q, 2 n).

    `far` leaves the terms k = 1 and -1 out.
    """
    sums = np.zeros(len(bernoulli))
    for n in range(len(sums)):  # B_n(late) / n!
        power = 1.0
        for k in range(n + 1):
            sums[n] += bernoulli[n, k] * power
            power *= late
    if far:
        size = 1.0
        for n in range(1, len(sums)):
            size /= 2 * math.pi
            sums[n] += 2 * math.cos(2 * math.pi * late - 0.5 * math.pi * n) * size
    count, half = out.shape[1], out.shape[1] // 2
    for q in range(out.shape[0]):
        for p in range(count):
            sign = -1.0 if p % 4 >= 2 else 1.0
            out[q, p % 2 * half + p // 2] = sign * binomials[q, p] * sums[p + q + 1]


@kernel(inline=True)
def _combine(matrix: Floats, h: Floats, out: Floats) -> None:
    out[:] = 0.0
    for q in range(len(h)):
        weight = h[q]
        for p in range(len(out)):
            out[p] += weight * matrix[q, p]


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
def _space(form: RationalArrays) -> Space:
    nodes, order = len(form.theta), form.binomials.shape[1]
    return Space(
        np.empty(form.binomials.shape),
        np.empty(form.binomials.shape),
        np.empty(order),
        np.empty(order),
        np.empty(nodes),
        np.empty(nodes),
        np.empty(nodes),
        np.empty(nodes),
        np.empty(nodes),
        np.empty(nodes),
        np.empty(nodes),
        np.empty(nodes),
    )


@kernel(inline=True)
def _respond(form: RationalArrays, row: int, space: Space, real: Floats, imag: Floats) -> None:
    """The response of one row at all nodes."""
    matrix, far_matrix, tail, far_tail = space[:4]
    ne, no, de, do, tail_re, tail_im, factor_re, factor_im = space[4:]
    theta, turns = form.theta, form.turns[row]
    late = turns - math.floor(turns)
    if row == 0 or turns != form.turns[row - 1]:
        _alias_matrix(late, False, form.bernoulli, form.binomials, matrix)
        if len(form.high):
            _alias_matrix(late, True, form.bernoulli, form.binomials, far_matrix)
        _delay(turns, theta, form.hold, factor_re, factor_im)
    top, bottom, half = form.numerator[row], form.denominator[row], len(tail) // 2
    _combine(matrix, form.series[row], tail)
    _values(top[0], theta, ne)
    _values(top[1], theta, no)
    _values(bottom[0], theta, de)
    _values(bottom[1], theta, do)
    _long(tail[:half], theta, tail_re)
    _long(tail[half:], theta, tail_im)
    if len(form.high):
        _combine(far_matrix, form.series[row], far_tail)
    for node in range(len(theta)):
        x = theta[node]
        z = x * x
        size = 1.0 / (x * (de[node] * de[node] + z * do[node] * do[node]))
        re = x * size * (no[node] * de[node] - ne[node] * do[node]) + tail_re[node]
        im = x * tail_im[node] - size * (ne[node] * de[node] + z * no[node] * do[node])
        real[node] = re * factor_re[node] - im * factor_im[node]
        imag[node] = re * factor_im[node] + im * factor_re[node]
    for node in form.high:
        value = _near_nyquist(top, bottom, far_tail, late, theta[node])
        value *= complex(factor_re[node], factor_im[node])
        real[node], imag[node] = value.real, value.imag
    if form.pole_count[row] != 0:
        _add_poles(form, row, space, real, imag)


@kernel(inline=True)
def _add_poles(form: RationalArrays, row: int, space: Space, real: Floats, imag: Floats) -> None:
    """Add the closed form of a row's poles; a negative count: they are all there is."""
    re, im = space.ne, space.no
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
    if form.pole_count[row] < 0:
        real[:], imag[:] = 0.0, 0.0
    whole = math.floor(form.turns[row])
    for node in range(len(re)):
        c, s = cos_sin(form.theta[node] * whole)
        real[node] += re[node] * c + im[node] * s
        imag[node] += im[node] * c - re[node] * s


@kernel
def respond(form: RationalArrays, out: Floats) -> None:
    """The response of every row; `out` is (B, 2, L), real and imaginary part."""
    space = _space(form)
    for row in range(len(out)):
        _respond(form, row, space, out[row, 0], out[row, 1])


@kernel(inline=True)
def _deviate(
    windows: WindowArrays, number: int, real: Floats, imag: Floats, re: Floats, im: Floats
) -> None:
    """z - R g in all windows, of the combination with this number."""
    count, nodes = len(re), windows.design_re.shape[1]
    target_re, target_im = windows.target_re[number], windows.target_im[number]
    design_re, design_im = windows.design_re[number], windows.design_im[number]
    if nodes == 3:  # in one go
        a, b, c = design_re[0], design_re[1], design_re[2]
        d, e, f = design_im[0], design_im[1], design_im[2]
        g, h, i = real[:count], real[count : 2 * count], real[2 * count :]
        u, v, w = imag[:count], imag[count : 2 * count], imag[2 * count :]
        for n in range(count):
            left = target_re[n] - a[n] * g[n] - b[n] * h[n] - c[n] * i[n]
            re[n] = left + d[n] * u[n] + e[n] * v[n] + f[n] * w[n]
            left = target_im[n] - a[n] * u[n] - b[n] * v[n] - c[n] * w[n]
            im[n] = left - d[n] * g[n] - e[n] * h[n] - f[n] * i[n]
        return
    re[:], im[:] = target_re, target_im
    for node in range(nodes):
        a, d = design_re[node], design_im[node]
        g, u = real[node * count : (node + 1) * count], imag[node * count : (node + 1) * count]
        for n in range(count):
            re[n] += d[n] * u[n] - a[n] * g[n]
            im[n] -= a[n] * u[n] + d[n] * g[n]


@kernel(inline=True)
def _powers(
    windows: WindowArrays, real: Floats, imag: Floats, power: Floats, re: Floats, im: Floats
) -> None:
    """s0 + |z - R g|^2 in all windows."""
    if windows.triangular:
        _triangular_powers(windows, real, imag, power)
        return
    power[:] = windows.scatter
    for number in range(len(windows.target_re)):
        _deviate(windows, number, real, imag, re, im)
        for window in range(len(power)):
            power[window] += re[window] * re[window] + im[window] * im[window]


@kernel(inline=True)
def _triangular_powers(windows: WindowArrays, real: Floats, imag: Floats, power: Floats) -> None:
    """The same for three nodes and triangular R: random excitation."""
    count = len(power)
    a, b, c = windows.design_re[0, 0], windows.design_re[0, 1], windows.design_re[0, 2]
    d, e, f = windows.design_re[1, 1], windows.design_re[1, 2], windows.design_re[2, 2]
    aj, bj, cj = windows.design_im[0, 0], windows.design_im[0, 1], windows.design_im[0, 2]
    dj, ej, fj = windows.design_im[1, 1], windows.design_im[1, 2], windows.design_im[2, 2]
    x, y, z = windows.target_re[0], windows.target_re[1], windows.target_re[2]
    xj, yj, zj = windows.target_im[0], windows.target_im[1], windows.target_im[2]
    g, h, i = real[:count], real[count : 2 * count], real[2 * count :]
    gj, hj, ij = imag[:count], imag[count : 2 * count], imag[2 * count :]
    scatter = windows.scatter
    for n in range(count):
        re = x[n] - a[n] * g[n] - b[n] * h[n] - c[n] * i[n]
        re = re + aj[n] * gj[n] + bj[n] * hj[n] + cj[n] * ij[n]
        im = xj[n] - a[n] * gj[n] - b[n] * hj[n] - c[n] * ij[n]
        im = im - aj[n] * g[n] - bj[n] * h[n] - cj[n] * i[n]
        total = scatter[n] + re * re + im * im
        re = y[n] - d[n] * h[n] - e[n] * i[n] + dj[n] * hj[n] + ej[n] * ij[n]
        im = yj[n] - d[n] * hj[n] - e[n] * ij[n] - dj[n] * h[n] - ej[n] * i[n]
        total = total + re * re + im * im
        re = z[n] - f[n] * i[n] + fj[n] * ij[n]
        im = zj[n] - f[n] * ij[n] - fj[n] * i[n]
        power[n] = total + re * re + im * im


@kernel
def deviations(form: RationalArrays, windows: WindowArrays, scale: Floats, out: Floats) -> None:
    """(z - R g) times the window's scale, for every row; `out` is (B, W, r, 2)."""
    space = _space(form)
    count = len(windows.weight)
    real, imag = np.empty(len(form.theta)), np.empty(len(form.theta))
    re, im = np.empty(count), np.empty(count)
    for row in range(len(out)):
        _respond(form, row, space, real, imag)
        for number in range(out.shape[2]):
            _deviate(windows, number, real, imag, re, im)
            for window in range(len(scale)):
                out[row, window, number, 0] = scale[window] * re[window]
                out[row, window, number, 1] = scale[window] * im[window]


@kernel
def log_likelihood(form: RationalArrays, windows: WindowArrays, out: Floats) -> None:
    """- sum over windows of (n - 1) log(s0 + |z - R g|^2), for every row; `out` is (B,)."""
    space = _space(form)
    count = len(windows.weight)
    real, imag = np.empty(len(form.theta)), np.empty(len(form.theta))
    re, im, power = np.empty(count), np.empty(count), np.empty(count)
    mantissa = np.empty(count, np.int64)
    for row in range(len(out)):
        _respond(form, row, space, real, imag)
        _powers(windows, real, imag, power, re, im)
        out[row] = -weighted_logs(power, windows.weight, mantissa, re)
