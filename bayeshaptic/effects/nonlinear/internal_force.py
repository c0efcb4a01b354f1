"""Simulating an internal force that depends on the motion it changes.

The command drives the linear mechanism; the force (friction, a hardening spring, a gap) acts
inside it and moves it further.  Only the further motion is simulated, on a fine grid, with the
exact step of the linear mechanism; the force of a step is found together with its end, so that dry
friction sticks exactly.  The recording is cut into segments that advance side by side, several
times over, each from where the one before it ended the last time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.types import Floats


@dataclass
class Step:
    """What a law knows of one step, in all segments side by side.

    Attributes
    ----------
    position, velocity : ndarray, shape (segments,)
        In the middle of the step, if the force were absent during it.
    last_velocity : ndarray, shape (segments,)
        At the end of the step, likewise.
    gain : float
        What a unit force adds to the last velocity.
    before : ndarray, shape (segments,)
        The force of the step before.
    duration_s : float
    """

    position: Floats
    velocity: Floats
    last_velocity: Floats
    gain: float
    before: Floats
    duration_s: float


Law = Callable[[Step], Floats]
"""The force of a step, shape (segments,)."""

_SEGMENT_S = 0.3
_SWEEPS = 15
_SETTLED = 4e-4  # relative change of the segments' starts


@dataclass(frozen=True)
class Place:
    """Where an internal force acts: on one mass against the ground, or between two masses.

    Attributes
    ----------
    first : int
    second : int or None
        None: the ground.
    """

    first: int = 0
    second: int | None = None


MOTOR = Place(0, None)
LOAD = Place(1, None)
CONNECTION = Place(0, 1)


@dataclass(frozen=True)
class Forced:
    """What an internal force adds to the motion.

    Attributes
    ----------
    motor_position : ndarray, shape (N,)
        To what the encoder reads, at the samples.
    starts : ndarray, shape (states, segments)
        State at the start of every segment; a later call with a force much the same begins here.
    """

    motor_position: Floats
    starts: Floats


def forced_motion(
    mechanism: Mechanism,
    place: Place,
    law: Law,
    position: Floats,
    velocity: Floats,
    step_s: float,
    substeps: int,
    starts: Floats | None = None,
) -> Forced:
    """Simulate what an internal force adds to the motion.

    Parameters
    ----------
    mechanism : Mechanism
        A batch of one.
    place : Place
    law : callable
    position, velocity : ndarray, shape (N * substeps,)
        Motion at `place` without the force: of the mass, or of the first mass relative to the
        second. Against the ground the position is the one with the force: it is measured.
    step_s : float
        Step of the fine grid.
    substeps : int
        Steps a sampling period.
    starts : ndarray, shape (states, segments), optional
        Where the segments start, from an earlier call.

    Returns
    -------
    Forced
    """
    state, drive, at_position, at_velocity = _stepper(mechanism, place, step_s)
    length = max(int(_SEGMENT_S / step_s) // substeps, 1) * substeps
    count = -(-len(position) // length)
    padding = (0, count * length + 1 - len(position))
    index = np.arange(length)[:, None] + length * np.arange(count)[None, :]
    ahead = np.stack([np.pad(a, padding, mode="edge") for a in (position, velocity)])
    ahead = np.stack(
        [*(0.5 * (ahead[:, index] + ahead[:, index + 1])), ahead[1, index + 1]], axis=1
    )
    gain = float(at_velocity @ drive)
    nothing = np.zeros(count)
    step = Step(nothing, nothing, nothing, gain, nothing, step_s)
    reading = np.concatenate([mechanism.drive_vector(), np.zeros(len(state) // 2)])
    moving = slice(len(state) // 2, None)
    if starts is None:
        starts = np.zeros((len(state), count))
    motor = np.empty((length // substeps, count))
    pull = drive[:, None]
    read = np.stack([at_position, at_velocity])
    read = np.stack([*(0.5 * (read + read @ state)), at_velocity @ state])
    for _ in range(_SWEEPS):
        z = starts.copy()
        # A segment begins with the force that the one before it ended with the last time.
        step.before = np.concatenate([[0.0], step.before[:-1]])
        for k in range(length):
            if k % substeps == 0:
                motor[k // substeps] = reading @ z
            step.position, step.velocity, step.last_velocity = read @ z + ahead[k]
            step.before = law(step)
            z = state @ z + pull * step.before
        # Each segment starts where the one before it ended: friction forgets its beginning.
        used, starts = starts, np.concatenate([np.zeros_like(z[:, :1]), z[:, :-1]], axis=1)
        size = np.sqrt(np.mean(starts[moving] ** 2)) + 1e-300
        if np.sqrt(np.mean((starts - used)[moving] ** 2)) < _SETTLED * size:
            break
    motor += _mended(state, reading, length, substeps, used, z)
    return Forced(motor.T.ravel()[: len(position) // substeps], starts)


def _mended(
    state: Floats, reading: Floats, length: int, substeps: int, used: Floats, ends: Floats
) -> Floats:
    """What the motor's position lacks for segments that fit each other, for the forces found.

    The mechanism is linear in the forces: where every segment really starts follows from them, and
    what a wrong start did is the mechanism's own motion from there.
    """
    over = np.linalg.matrix_power(state, length)
    forced = ends - over @ used
    true = np.zeros_like(used)
    for s in range(1, used.shape[1]):
        true[:, s] = over @ true[:, s - 1] + forced[:, s - 1]
    period = np.linalg.matrix_power(state, substeps)
    rows = np.empty((length // substeps, len(state)))
    rows[0] = reading
    for k in range(1, len(rows)):
        rows[k] = rows[k - 1] @ period
    return np.asarray(rows @ (true - used))


def _stepper(
    mechanism: Mechanism, place: Place, step_s: float
) -> tuple[Floats, Floats, Floats, Floats]:
    """Exact step of the mechanism, of a unit force held over it, and what is read at `place`."""
    a = mechanism.state_matrix()[0]
    size, n = len(a), len(mechanism.masses)
    push = np.zeros(size)
    at_position, at_velocity = np.zeros(size), np.zeros(size)
    for mass, sign in ((place.first, 1.0), (place.second, -1.0)):
        if mass is not None:
            push[n + mass] = sign / float(mechanism.masses[mass][0])
            # Against the ground the measured position counts, which holds everything already.
            at_position[mass] = sign if place.second is not None else 0.0
            at_velocity[n + mass] = sign
    block = np.zeros((size + 1, size + 1))
    block[:size, :size], block[:size, size] = a, push
    step = expm(block * step_s)
    return step[:size, :size], step[:size, size], at_position, at_velocity
