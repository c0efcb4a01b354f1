r"""Leakage of modes that ring on: it has their poles, and no polynomial in a window has those.

Between samples a linear device is a state that grows by a matrix.  The leakage of a record of N
samples is what its two ends make of that,

.. math:: T(z) \propto C (z I - F)^{-1} (x_0 - x_N),

so that a mode of the pole p adds one column, 1 / (z - p), whatever the zeros of the response are.
Where a mode is damped so little that its peak is a few lines wide, that column is not smooth
over a window; left in, it looked like noise, up to 70 dB above the encoder's.  Near its mode the
response has the same pole, so that force and position tell it: in each window

.. math:: Y = \frac{b_0 + b_1 x + b_2 x^2}{x - p} U + \frac{t}{x - p} + \text{smooth leakage},

linear but for p, which least squares find (variable projection: G. H. Golub and V. Pereyra, *SIAM
Journal on Numerical Analysis* 10(2), 1973).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.numerics.triangular import back_substituted
from bayeshaptic.recordings.response.local_polynomial import NODES, project_out
from bayeshaptic.recordings.response.regressors import Block, regressors
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.response.window_reference import unit_mass

# Log likelihood that a pole must take off a window, and of that what only a pole of the response
# takes: a tone has none. A hum is taken for a mode in one of 60 recordings, and recordings of
# ordinary length have no such window.
RINGS, ITS_RESPONSE = 25.0, 10.0
# Of a line: what is damped less does not end with the record, and is a tone.
LEAST_DAMPED = 0.1
# A pole costs a window two lines, and of these at least five must be left.
FEWEST_LINES = 12
# Rounds of the search, and how near to a line (in lines) and how far from a window (in half-widths)
# it looks. Of 54 windows of 40 short recordings none is decided otherwise by half or twice the
# rounds, by a quarter or 2.5 times the nearness, or by twice the reach; half the reach changes 8.
_LINEAR_ROUNDS, _ROUNDS = 4, 10
_NEAREST, _FARTHEST = 0.02, 4.0


def ringing_poles(
    spectra: RandomSpectra, curved: NDArray[Any], scatter: NDArray[Any]
) -> NDArray[Any] | None:
    """Poles of modes whose leakage a window shows, Hz, nan where none, shape (W,); None: nowhere.

    Parameters
    ----------
    spectra : RandomSpectra
    curved : ndarray of bool, shape (W,)
        Windows whose response is more than a parabola; these are tried, and those beside them.
    scatter : ndarray, shape (W,)
        Of the windows with the best reference that they have without a pole.
    """
    tried = _or_beside(curved) & (np.diff(spectra.edges) >= FEWEST_LINES)
    poles_hz, left = np.full(len(tried), np.nan, complex), np.full(len(tried), np.inf)
    floor = spectra.freedom * spectra.floor
    for block in _blocks(spectra, tried):
        own = block.window
        promising = scatter[own] * np.exp(-RINGS / 2 / (spectra.freedom[own] - 1)) - floor[own]
        poles_hz[own], left[own] = _poles(spectra, block, promising)
    left += floor

    def explains(more: NDArray[Any], enough: float) -> NDArray[Any]:
        return (spectra.freedom - 1) * (np.log(more) - np.log(left)) > enough

    line = spectra.frequency_hz[1] - spectra.frequency_hz[0]
    found = explains(scatter, RINGS) & (poles_hz.imag > LEAST_DAMPED * line)
    if not found.any():
        return None
    poles_hz[~found] = np.nan
    as_a_tone = scatter.copy()
    for block in _blocks(spectra, found):
        as_a_tone[block.window] = _left_by_tones(spectra, block, poles_hz[block.window, None])
    rings = found & _or_beside(found & explains(as_a_tone, ITS_RESPONSE))
    poles_hz[~rings] = np.nan
    return poles_hz if rings.any() else None


def _blocks(spectra: RandomSpectra, chosen: NDArray[Any]) -> Iterator[Block]:
    """Some windows, those of similar width together; their `window` is an array of numbers."""
    for block in spectra.blocks:
        rows = np.flatnonzero(chosen[block.window])
        if len(rows):
            own = np.arange(len(chosen))[block.window][rows]
            yield Block(own, *(values[rows] for values in block[1:]))


def _or_beside(chosen: NDArray[Any]) -> NDArray[Any]:
    return np.convolve(chosen, np.ones(3), "same") > 0


def _left_by_tones(spectra: RandomSpectra, block: Block, poles_hz: NDArray[Any]) -> NDArray[Any]:
    """What poles, shape (R, 1), leave where the response is a parabola without them, (R,)."""
    smooth = regressors(spectra.frequency_hz, spectra.nodes_hz, unit_mass, None)
    tone = (block.whitened / (spectra.frequency_hz[block.line] - poles_hz))[..., None]
    columns = np.concatenate([tone, block.force[..., None] * smooth.response(block)], axis=-1)
    q = np.linalg.qr(project_out(block.leakage, columns))[0]
    rest = np.sum(np.abs(project_out(q, block.position[..., None])) ** 2, axis=(1, 2))
    return np.asarray(rest + spectra.freedom[block.window] * spectra.floor[block.window])


def _poles(
    spectra: RandomSpectra, block: Block, promising: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Poles that leave least in the windows of a block, Hz, and what they leave; shape (R,).

    Looked for half as long where none leaves less than what would be `promising`, shape (R,).
    """
    nodes = spectra.nodes_hz[block.window]
    centre = nodes[:, 1:2]
    half = (nodes[:, 2:] - centre) / NODES[2]
    x = (spectra.frequency_hz[block.line] - centre) / half
    inside = block.whitened > 0
    line = _NEAREST * 2 / (inside.sum(axis=1, keepdims=True) - 1)
    powers = np.stack([np.ones_like(x), x, x**2], axis=-1)
    forced = block.force[..., None] * powers
    y = spectra.position[block.line] * block.whitened

    pole = 1j * np.ones_like(centre)  # broad
    weight = inside.astype(float)
    for _ in range(_LINEAR_ROUNDS):
        # (x - p) Y is linear in p, the response's numerator and the leakage's.
        columns = np.concatenate([block.leakage, (x**3 * inside)[..., None], forced], -1)
        basis = np.linalg.qr(columns * weight[..., None])[0]
        known = project_out(basis, (weight * y)[..., None])
        moved = project_out(basis, (weight * x * y)[..., None])
        pole = _bounded(_quotient(known, moved), line)
        weight = inside / np.abs(x - pole)
    best, least = pole, np.full(len(pole), np.inf)
    for number in range(_ROUNDS):
        if number == _ROUNDS // 2 and not np.any(least < promising):
            break
        peak = inside / (x - pole)
        columns = np.concatenate([peak[..., None], forced * peak[..., None]], -1)
        q, triangle = np.linalg.qr(project_out(block.leakage, columns))
        z = q.conj().swapaxes(-1, -2) @ block.position[..., None]
        rest = block.position[..., None] - q @ z
        scatter = np.sum(np.abs(rest) ** 2, axis=(1, 2))
        better = scatter < least
        best = np.where(better[:, None], pole, best)
        least = np.where(better, scatter, least)
        coefficients = back_substituted(triangle, z[..., 0])
        slope = (columns @ coefficients[..., None]) * peak[..., None]
        slope = project_out(q, project_out(block.leakage, slope))
        pole = _bounded(pole + _quotient(slope, rest), line)
    return (centre + half * best)[:, 0], least


def _quotient(by: NDArray[Any], of: NDArray[Any]) -> NDArray[Any]:
    """Least squares of one column on another, (W, w, 1) each; shape (W, 1)."""
    power = np.sum(np.abs(by) ** 2, axis=1) + np.finfo(float).tiny
    return np.asarray(np.sum(by.conj() * of, axis=1) / power)


def _bounded(pole: NDArray[Any], least: NDArray[Any]) -> NDArray[Any]:
    """Damped, and not far from the window."""
    real = np.clip(pole.real, -_FARTHEST, _FARTHEST)
    return np.asarray(real + 1j * np.clip(pole.imag, least, _FARTHEST))
