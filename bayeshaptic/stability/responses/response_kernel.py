"""Terms and values of a `PoleResponse`, compiled.

In plain NumPy `from_poles` of `tests/references/plain_response.py` is the same.  It contains
`held_pole.py` of the sampled response, and is to be compiled anew where that is changed.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.models.response.kernels.held_pole import held_pole
from bayeshaptic.numerics.cos_sin import cos_sin
from bayeshaptic.types import Complexes, Floats, Ints


@kernel
def values(
    direct: Complexes,
    late: Complexes,
    centre: Complexes,
    delay: Floats,
    exact: bool,
    rows: Ints,
    theta: Floats,
    out: Complexes,
) -> None:
    """The response of loops `rows`, shape (M,), at angles `theta`, shape (M, k), into `out`."""
    count = theta.shape[1]
    re, im, cosine, sine = np.empty(count), np.empty(count), np.empty(count), np.empty(count)
    point, along = np.empty(count), np.empty(count)
    for m in range(len(rows)):
        row = rows[m]
        for k in range(count):
            half_c, half_s = cos_sin(0.5 * theta[m, k])
            re[k], im[k] = 0.0, 0.0
            cosine[k], sine[k] = 1.0 - 2.0 * half_s * half_s, 2.0 * half_s * half_c
            point[k] = -2.0 * half_s * half_s if exact else 0.0
            along[k] = sine[k] if exact else theta[m, k]
        for pole in range(direct.shape[1]):
            d, e, centre_here = direct[row, pole], late[row, pole], centre[row, pole]
            for k in range(count):
                above_re = d.real + e.real * cosine[k] + e.imag * sine[k]
                above_im = d.imag + e.imag * cosine[k] - e.real * sine[k]
                below_re, below_im = point[k] - centre_here.real, along[k] - centre_here.imag
                size = 1.0 / (below_re * below_re + below_im * below_im)
                re[k] += size * (above_re * below_re + above_im * below_im)
                im[k] += size * (above_im * below_re - above_re * below_im)
        for k in range(count):
            c, s = cos_sin(theta[m, k] * delay[row])
            out[m, k] = complex(re[k] * c + im[k] * s, im[k] * c - re[k] * s)


@kernel
def held(
    poles: Complexes,
    residues: Complexes,
    late: Floats,
    direct: Complexes,
    second: Complexes,
    centre: Complexes,
) -> None:
    """The terms of all poles behind a hold and a delay of less than a period.

    Parameters
    ----------
    poles, residues : ndarray, shape (B, n)
        Times T each.
    late : ndarray, shape (B,)
        The delay in periods.
    direct, second, centre : ndarray, shape (B, n)
        Become numerators without and with a further z^-1, and what is subtracted from z - 1.
    """
    for row in range(len(poles)):
        for i in range(poles.shape[1]):
            found = held_pole(poles[row, i], residues[row, i], late[row])
            direct[row, i], second[row, i], centre[row, i] = found
