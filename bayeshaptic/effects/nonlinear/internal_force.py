"""Simulating an internal force that depends on the motion it changes.

The command drives the linear mechanism; the force (friction, a hardening spring, a gap) acts
inside it and moves it further.  Only the further motion is simulated, on a fine grid, with the
exact step of the linear mechanism; the force of a step is found together with its end, so that dry
friction sticks exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from bayeshaptic.compiled import callback
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.types import Floats

Force = Callable[[float, float, float, float, float, float, Floats], float]
"""The force of one step, compiled when it is first simulated: a function of a module that uses
`math` and its arguments alone.  These are

position, velocity
    in the middle of the step, if the force were absent during it;
last velocity
    at the end of the step, likewise;
gain
    what a unit force adds to the last velocity;
before
    the force of the step before;
duration
    of the step, s;
constants
    array: the law's strength and shape."""


@dataclass(frozen=True)
class Law:
    """A law of a force, with the values of its constants.

    Attributes
    ----------
    force : Force
    constants : tuple of float
    """

    force: Force
    constants: tuple[float, ...]


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


def forced_motion(
    mechanism: Mechanism,
    place: Place,
    law: Law,
    position: Floats,
    velocity: Floats,
    step_s: float,
    substeps: int,
) -> Floats:
    """Simulate what an internal force adds to the motion.

    Parameters
    ----------
    mechanism : Mechanism
        A batch of one.
    place : Place
    law : Law
    position, velocity : ndarray, shape (N * substeps,)
        Motion at `place` without the force: of the mass, or of the first mass relative to the
        second. Against the ground the position is the one with the force: it is measured.
    step_s : float
        Step of the fine grid.
    substeps : int
        Steps a sampling period.

    Returns
    -------
    ndarray, shape (N,)
        What the force adds to the motor's position at the samples.
    """
    from bayeshaptic.effects.nonlinear.stepping_kernel import step_through

    return step_through(
        *steps(mechanism, place, step_s),
        np.ascontiguousarray(position),
        np.ascontiguousarray(velocity),
        step_s,
        substeps,
        callback(law.force),
        np.array(law.constants, float),
    )


def steps(
    mechanism: Mechanism, place: Place, step_s: float
) -> tuple[Floats, Floats, float, Floats]:
    """Exact steps, as `stepping_kernel.step_through` takes them: matrix, drive, gain, reading."""
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
    state, drive = step[:size, :size], np.ascontiguousarray(step[:size, size])
    middle = [0.5 * (row + row @ state) for row in (at_position, at_velocity)]
    matrix = np.concatenate([state, np.stack([*middle, at_velocity @ state])])
    reading = np.concatenate([mechanism.drive_vector(), np.zeros(size // 2)])
    return matrix, drive, float(at_velocity @ drive), reading
