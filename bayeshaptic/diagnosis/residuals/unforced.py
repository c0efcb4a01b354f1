"""The motion that neither the command nor forces make, and the whole motion of a fit.

A hand moves a device slowly, and the encoder sees it; a free one goes on as it began, and as a
constant force makes it.
"""

from __future__ import annotations

import numpy as np
from numpy.linalg import lstsq

from bayeshaptic.inference.fit import Fit
from bayeshaptic.models.response.motion import linear_motion, linear_motions
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.low_pass import low_pass
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

# Hands tremble at up to 12 Hz, which has to come through whole; the encoder's steps are noise of
# velocity that grows with the edge to the power of 3/2, and may be this share of the motion's.  At
# the true parameters of held LHIfAMs that rub, under steps, log likelihoods rise from 128 and 1,556
# to 252 and 1,601 when the edge goes from 20 Hz (and half the order) to 30; on the coarse encoder
# of PHANToMs they fall from 58 and 27 to -19 and -48, and are 43 and 38 at 16 Hz.
_LEAST_HZ, _MOST_HZ, _NOISE = 14.0, 30.0, 0.01
_ALIKE = 1e-14  # squares: motions that differ by a ten-millionth are one


def hand_edge_hz(position: Floats, period_s: float) -> float:
    """Up to where the encoder tells better what a hand does than nothing, in Hz.

    Parameters
    ----------
    position : ndarray, shape (N,)
        Measured.
    period_s : float
    """
    most = min(_MOST_HZ, 0.4 / period_s)
    count = increment_unit(position)
    if count is None:
        return most
    velocity = float(np.std(np.gradient(low_pass(position, most, period_s), period_s)))
    # Rounding is white: its velocity up to an edge f has (2 pi)^2 2 T f^3 / 3 of its variance.
    unit = count / np.sqrt(12) * 2 * np.pi * np.sqrt(2 * period_s / 3)
    return float(np.clip((_NOISE * velocity / unit) ** (2 / 3), min(_LEAST_HZ, most), most))


def coasting_motions(system: LinearSystem, samples: int, period_s: float) -> Floats:
    """Of a free device: standing still, and what a constant force and a push do, shape (N, 3)."""
    steady = np.ones(samples)
    return np.stack([steady, *linear_motion(system, steady, period_s)], axis=1)


def parts(columns: Floats, motion: Floats) -> Floats:
    """How much of each column (N, C) a motion (N,) has, by least squares; shape (C,)."""
    size = np.linalg.norm(columns, axis=0)
    alike = columns.T @ columns / np.outer(size, size)
    return np.asarray(lstsq(alike, columns.T @ motion / size, rcond=_ALIKE)[0] / size)


def commanded_motions(fit: Fit, recording: Recording, masses: tuple[int, ...] = (0,)) -> Floats:
    """What the command alone does to masses: positions and velocities, shape (M, 2, N)."""
    force = recording.force - recording.force.mean()
    return linear_motions(fit.model.system(fit.theta).of_masses, force, recording.period_s, masses)


def commanded_position(fit: Fit, recording: Recording) -> Floats:
    """What the command alone makes of the position that is read, shape (N,)."""
    force = recording.force - recording.force.mean()
    return linear_motion(fit.model.system(fit.theta), force, recording.period_s)[0]


def fitted_motion(fit: Fit, recording: Recording, acted: Floats | float) -> Floats:
    """The motor's position without the encoder's noise, shape (N,).

    Parameters
    ----------
    fit : Fit
    recording : Recording
        Without what forces do.
    acted : ndarray, shape (N,), or 0
        What they add to the position.
    """
    known, period_s = commanded_position(fit, recording), recording.period_s
    left = recording.position - known
    if fit.model.held:
        edge_hz = hand_edge_hz(recording.position + acted, period_s)
        return np.asarray(acted + known + low_pass(left, edge_hz, period_s))
    columns = coasting_motions(fit.model.system(fit.theta), len(left), period_s)
    return np.asarray(acted + known + columns @ parts(columns, left))
