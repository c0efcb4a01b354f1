"""The compiled part of the likelihood: responses put into the windows of a recording.

It contains `rational.py` beside it, and is to be compiled anew where that is changed.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.models.response.kernels.arrays import RationalArrays, WindowArrays
from bayeshaptic.models.response.kernels.rational import (
    TOGETHER,
    respond_together,
    rows_from,
    space_of,
)
from bayeshaptic.numerics.weighted_logs import weighted_logs
from bayeshaptic.types import Floats


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
def _powers(windows: WindowArrays, response: Floats, re: Floats, im: Floats, out: Floats) -> None:
    """s0 + |z - R g|^2 in all windows, for some rows; `out` is (rows, W)."""
    if windows.triangular:
        _triangular_powers(windows, response, out)
        return
    for row in range(len(out)):
        for window in range(out.shape[1]):
            out[row, window] = windows.scatter[window]
        for number in range(len(windows.target_re)):
            _deviate(windows, number, response[row, 0], response[row, 1], re, im)
            for window in range(out.shape[1]):
                out[row, window] += re[window] * re[window] + im[window] * im[window]


@kernel(inline=True)
def _triangular_powers(windows: WindowArrays, response: Floats, out: Floats) -> None:
    """The same for three nodes and triangular R: random excitation."""
    count = out.shape[1]
    a, b, c = windows.design_re[0, 0], windows.design_re[0, 1], windows.design_re[0, 2]
    d, e, f = windows.design_re[1, 1], windows.design_re[1, 2], windows.design_re[2, 2]
    aj, bj, cj = windows.design_im[0, 0], windows.design_im[0, 1], windows.design_im[0, 2]
    dj, ej, fj = windows.design_im[1, 1], windows.design_im[1, 2], windows.design_im[2, 2]
    x, y, z = windows.target_re[0], windows.target_re[1], windows.target_re[2]
    xj, yj, zj = windows.target_im[0], windows.target_im[1], windows.target_im[2]
    scatter = windows.scatter
    for row in range(len(out)):
        real, imag = response[row, 0], response[row, 1]
        g, h, i = real[:count], real[count : 2 * count], real[2 * count :]
        gj, hj, ij = imag[:count], imag[count : 2 * count], imag[2 * count :]
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
            out[row, n] = total + re * re + im * im


@kernel
def deviations(form: RationalArrays, windows: WindowArrays, scale: Floats, out: Floats) -> None:
    """(z - R g) times the window's scale, for every row; `out` is (B, W, r, 2)."""
    space, count, first = space_of(form), len(windows.weight), 0
    re, im = np.empty(count), np.empty(count)
    while first < len(out):
        last = rows_from(first, form)
        respond_together(form, first, last, space)
        for row in range(first, last):
            real, imag = space.response[row - first, 0], space.response[row - first, 1]
            for number in range(out.shape[2]):
                _deviate(windows, number, real, imag, re, im)
                for window in range(len(scale)):
                    out[row, window, number, 0] = scale[window] * re[window]
                    out[row, window, number, 1] = scale[window] * im[window]
        first = last


@kernel
def log_likelihood(form: RationalArrays, windows: WindowArrays, out: Floats) -> None:
    """- sum over windows of (n - 1) log(s0 + |z - R g|^2), for every row; `out` is (B,)."""
    space, count, first = space_of(form), len(windows.weight), 0
    re, im, power = np.empty(count), np.empty(count), np.empty((TOGETHER, count))
    mantissa = np.empty(count, np.int64)
    while first < len(out):
        last = rows_from(first, form)
        respond_together(form, first, last, space)
        _powers(windows, space.response, re, im, power[: last - first])
        for row in range(first, last):
            out[row] = -weighted_logs(power[row - first], windows.weight, mantissa, re)
        first = last
