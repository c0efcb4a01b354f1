r"""How steeply the noise falls inside the lowest windows, which span up to an octave.

A hand that wanders moves a held device with a force that falls with a high power of the frequency,
through a device that falls, too.  Where a window is wide beside its frequency its first lines then
hold most of the noise, and taken for white it promises more than it says.  In a window the density
is a power, :math:`S(f) \propto f^{-p}`; p maximises the restricted likelihood of its lines (H. D.
Patterson and R. Thompson, *Biometrika* 58(3), 1971), with a Gaussian belief around the slope of the
levels of its neighbours.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.signals.rough_response import local_slopes
from bayeshaptic.types import Complexes, Floats

# Windows that reach from one frequency to so many times that; in narrower ones a slope of twelve
# changes the noise by less than a factor of two and a half either way.
_WIDE = 1.15
_POWERS = np.arange(-4.0, 17.0)
# One window of 24 lines, 16 of which are left over, knows its slope to some 1 (an octave) to 3.
_BELIEF_SD = 2.0
_NEAR = 0.5  # of log frequency: neighbours that tell a slope


def noise_slopes(spectra: RandomSpectra, left: Complexes | None = None) -> Floats:
    """The power with which the noise falls in each window; zero in narrow ones, shape (W,).

    Parameters
    ----------
    spectra : RandomSpectra
    left : complex ndarray, shape (L,), optional
        What a model leaves of the position; without, each window's own response is free.
    """
    first, last = spectra.edges[:-1], spectra.edges[1:] - 1
    wide = int(np.sum(spectra.frequency_hz[last] > _WIDE * spectra.frequency_hz[first]))
    slopes = np.zeros(len(first))
    if wide == 0:
        return slopes
    neighbours = 4
    count = min(wide + neighbours, len(first))
    likelihood, level = _with_each_power(spectra, count, left)
    log_f = np.log(spectra.middle_hz[:count])
    found = np.zeros(count)
    rounds = 3
    for _ in range(rounds):
        here = [np.interp(power, _POWERS, own) for power, own in zip(found, level, strict=True)]
        found[:wide] = -local_slopes(log_f, np.array(here), _NEAR)[:wide]
        found = np.clip(found, _POWERS[0], _POWERS[-1])
    belief = -0.5 * ((_POWERS - found[:wide, None]) / _BELIEF_SD) ** 2
    slopes[:wide] = _POWERS[np.argmax(likelihood[:wide] + belief, axis=1)]
    return slopes


def _with_each_power(
    spectra: RandomSpectra, count: int, left: Complexes | None
) -> tuple[Floats, Floats]:
    """Of the first windows with each of `_POWERS`, shapes (count, P).

    Log likelihood with leakage (and, where nothing is known to be left, a window's own response)
    integrated out, and log noise of a line.
    """
    line, inside, free = spectra.free(slice(0, count), response=left is None)
    measured = (spectra.position if left is None else left)[line] * inside
    there = np.linalg.norm(free, axis=1, keepdims=True)
    free = free / np.where(there > 0, there, 1.0)
    lines, freedom = inside.sum(axis=1), inside.sum(axis=1) - np.sum(there[:, 0] > 0, axis=1)
    frequency = spectra.frequency_hz[line]
    mean = np.sum(frequency * inside, axis=1) / lines
    log_f = np.where(inside, np.log(frequency / mean[:, None]), 0.0)
    rows = np.concatenate([free, measured[..., None]], axis=-1)
    weight = np.exp(0.5 * _POWERS[:, None] * log_f[:, None])
    triangle = np.linalg.qr(weight[..., None] * rows[:, None], mode="r")
    diagonal = np.abs(np.diagonal(triangle, axis1=-2, axis2=-1))
    power, inner = diagonal[..., -1] ** 2, diagonal[..., :-1]
    size = np.sum(np.log(np.where(there > 0, inner, 1.0)), axis=-1)
    floor = lines * spectra.floor[:count] + np.finfo(float).tiny
    level = np.log(np.maximum(power, floor[:, None]) / freedom[:, None])
    log_weight = _POWERS * log_f.sum(axis=1)[:, None]
    return log_weight - 2 * size - freedom[:, None] * level, level
