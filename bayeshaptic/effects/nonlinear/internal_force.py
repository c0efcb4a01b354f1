"""Simulating internal forces that depend on the motion they change.

The command drives the linear mechanism; forces (friction, a hardening spring, a gap) act inside it
and move it further, each in the motion that all of them make.  Only the further motion is
simulated, on a fine grid, with the exact step of the linear mechanism; the force of a step is found
together with its end, so that dry friction sticks exactly, and turns within the step in which the
motion does: with one force for all of that step a drag beside friction would have to stand out of
what the steps are off by.  In a gap an observer keeps to the measured motion.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from bayeshaptic.compiled import callback
from bayeshaptic.effects.nonlinear.observer import filtered
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
    sticks : bool
        Whether it is dry friction, which holds the mass where it can: `force` is its largest size.
    observed : bool
        Whether an observer corrects the position that it is told, between the motor and a mass.
    """

    force: Force
    constants: tuple[float, ...]
    sticks: bool = False
    observed: bool = False


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
class Internal:
    """An internal force and the motion at its place without any.

    Attributes
    ----------
    place : Place
    law : Law
    position, velocity : ndarray, shape (N * substeps,)
        Of the mass, or of the first mass relative to the second. Against the ground the position is
        the one with the forces: it is measured. Where it is observed, with the `correction`.
    """

    place: Place
    law: Law
    position: Floats
    velocity: Floats


def forced_motion(
    mechanism: Mechanism, forces: Sequence[Internal], step_s: float, substeps: int
) -> Floats:
    """Simulate what internal forces add to the motion, all of them at the same time.

    Parameters
    ----------
    mechanism : Mechanism
        A batch of one.
    forces : sequence of Internal
        Within a step each knows those before it: what sticks comes last.
    step_s : float
        Step of the fine grid.
    substeps : int
        Steps a sampling period: an even number, they are taken two at a time.

    Returns
    -------
    ndarray, shape (F, N)
        What each force adds to the motor's position at the samples.

    Raises
    ------
    ValueError
        An odd number of steps a period.
    """
    if substeps % 2:
        raise ValueError(f"{substeps} steps a sampling period: take an even number")
    from numba import NumbaExperimentalFeatureWarning

    from bayeshaptic.effects.nonlinear.stepping_kernel import step_through

    linear = steps(mechanism, forces, step_s)
    motion = tuple(
        (np.ascontiguousarray(force.position), np.ascontiguousarray(force.velocity))
        for force in forces
    )
    laws = tuple(callback(force.law.force) for force in forces)
    sticks = np.array([force.law.sticks for force in forces])
    constants, begins = numbers_of([force.law for force in forces])
    with warnings.catch_warnings():  # numba calls tuples of functions an experiment
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        return step_through(*linear, motion, step_s, substeps, laws, sticks, constants, begins)


def numbers_of(laws: Sequence[Law]) -> tuple[Floats, tuple[int, ...]]:
    """Strengths and shapes one after the other, and where those of each law begin."""
    numbers = [law.constants for law in laws]
    ends = np.cumsum([len(own) for own in numbers])
    return np.array(sum(numbers, ()), float), (0, *ends[:-1].tolist())


def steps(
    mechanism: Mechanism, forces: Sequence[Internal], step_s: float
) -> tuple[Floats, Floats, Floats, Floats, Floats]:
    """Exact steps: matrix, rows, drive, gains, reading, in the shapes that `step_through` takes."""
    a = mechanism.state_matrix()[0]
    reading = np.concatenate([mechanism.drive_vector(), np.zeros(len(a) // 2)])
    corrected = np.zeros_like(reading)
    if any(force.law.observed for force in forces):
        a, reading, corrected = filtered(a, reading)
    size, n, count = len(a), len(mechanism.masses), len(forces)
    push, at = np.zeros((size, count)), np.zeros((count, 2, size))
    for i, force in enumerate(forces):
        place = force.place
        for mass, sign in ((place.first, 1.0), (place.second, -1.0)):
            if mass is not None:
                push[n + mass, i] = sign / float(mechanism.masses[mass][0])
                # Against the ground the measured position counts, which holds everything already.
                at[i, 0, mass] = sign if place.second is not None else 0.0
                at[i, 1, n + mass] = sign
        if force.law.observed:
            at[i, 0] -= corrected
    block = np.zeros((size + count, size + count))
    block[:size, :size], block[:size, size:] = a, push
    step = expm(block * step_s)
    state, drive = step[:size, :size].copy(), step[:size, size:]
    middle = 0.5 * (at + at @ state)
    rows = np.concatenate([middle, at[:, 1:] @ state], axis=1)
    gains = np.concatenate([0.5 * at @ drive, at[:, 1:] @ drive], axis=1)
    return state, rows, drive.T.copy(), np.swapaxes(gains, 1, 2).copy(), reading
