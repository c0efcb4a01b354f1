r"""How steeply the noise falls inside the lowest windows, which span up to an octave.

A hand that wanders moves a held device with a force that falls with a high power of the frequency,
through a device that falls, too.  Where a window is wide beside its frequency its first lines then
hold most of the noise, and taken for white it promises more than it says.  In a window the density
is a power, :math:`S(f) \propto f^{-p}`; p maximises the restricted likelihood of its lines (H. D.
Patterson and R. Thompson, *Biometrika* 58(3), 1971), with a Gaussian belief around the slope of the
levels of its neighbours.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.types import Floats

# Windows that reach from one frequency to so many times that; in narrower ones a slope of twelve
# changes the noise by less than a factor of two and a half either way.
_WIDE = 1.15
_POWERS = np.arange(-4.0, 17.0)
# One window of 24 lines, 16 of which are left over, knows its slope to some 1 (an octave) to 3.
_BELIEF_SD = 2.0


def noise_slopes(spectra: RandomSpectra) -> Floats:
    """The power with which the noise falls in each window; zero in narrow ones, shape (W,)."""
    first, last = spectra.edges[:-1], spectra.edges[1:] - 1
    wide = int(np.sum(spectra.frequency_hz[last] > _WIDE * spectra.frequency_hz[first]))
    slopes = np.zeros(len(first))
    if wide == 0:
        return slopes
    neighbours = 4
    low = _lowest(spectra, min(wide + neighbours, len(first)))
    found = np.zeros(len(low.edges) - 1)
    log_f = np.log(low.nodes_hz[:, 1])
    rounds = 3
    for _ in range(rounds):
        windows = replace(low, noise_slope=found).windows()
        level = np.log(windows.scatter / windows.lines)
        found[:wide] = -_local_slopes(log_f, level)[:wide]
        found = np.clip(found, _POWERS[0], _POWERS[-1])
    for window in range(wide):
        belief = -0.5 * ((_POWERS - found[window]) / _BELIEF_SD) ** 2
        slopes[window] = _POWERS[np.argmax(_restricted_likelihood(low, window) + belief)]
    return slopes


def _lowest(spectra: RandomSpectra, count: int) -> RandomSpectra:
    """The first windows alone."""
    end = spectra.edges[count]
    return replace(
        spectra,
        frequency_hz=spectra.frequency_hz[:end],
        force=spectra.force[:end],
        position=spectra.position[:end],
        edges=spectra.edges[: count + 1],
        floor=spectra.floor[:count],
        ringing_hz=None if spectra.ringing_hz is None else spectra.ringing_hz[:count],
    )


def _local_slopes(x: Floats, y: Floats) -> Floats:
    """Slope of y over x around each x: weighted least squares."""
    near = 0.5  # of log frequency: neighbours that tell a slope
    weight = np.exp(-0.5 * ((x - x[:, None]) / near) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    apart = x - (weight @ x)[:, None]
    return np.asarray(np.sum(weight * apart * y, axis=1) / np.sum(weight * apart**2, axis=1))


def _restricted_likelihood(spectra: RandomSpectra, window: int) -> Floats:
    """Log likelihood of each of `_POWERS`, response and leakage integrated out."""
    lines, columns = spectra.columns(window)
    position, frequency = spectra.position[lines], spectra.frequency_hz[lines]
    columns = columns / np.linalg.norm(columns, axis=0)
    log_weight = _POWERS[:, None] * np.log(frequency / frequency.mean())
    weight = np.exp(0.5 * log_weight)
    q, r = np.linalg.qr(weight[..., None] * columns)
    weighted = weight * position
    explained = np.einsum("pli,pl->pi", q.conj(), weighted)
    left = np.sum(np.abs(weighted) ** 2, axis=1) - np.sum(np.abs(explained) ** 2, axis=1)
    left = np.maximum(left, len(position) * spectra.floor[window] + np.finfo(float).tiny)
    size = np.sum(np.log(np.abs(np.diagonal(r, axis1=1, axis2=2))), axis=1)
    freedom = len(position) - columns.shape[1]
    return np.asarray(log_weight.sum(axis=1) - 2 * size - freedom * np.log(left))
