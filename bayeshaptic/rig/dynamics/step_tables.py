"""What the steps of a plant need to know of it, as arrays; and what they remember."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import scipy.linalg

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.plant import Array, Plant
from bayeshaptic.rig.dynamics.propagate import Stretch, generator, layout, stretches


class Tables(NamedTuple):
    """Everything about a plant that its steps need: L forces, D delayed springs, P stretches.

    Attributes
    ----------
    matrix : ndarray, shape (P, halvings + 1, size, size)
        A step of the linear part, whole or halved so many times.
    constant, ramp : ndarray, shape (P, halvings + 1, L, size)
        Response at the end of the step to a force of 1 throughout, and one that grows from 0 to 1.
    grip : ndarray, shape (P, halvings + 1, L)
        Velocity that a force of 1 throughout gives its own coordinate.
    steps, new, step_s : ndarray, shape (P,)
        Number of steps of a stretch, whether the new command acts in it, and their length.
    place : ndarray of int, shape (L, 4)
        Where a law finds its relative position and velocity: x, what is taken off it, v, likewise;
        indices of states, -1 for nothing.
    dry : ndarray of bool, shape (L,)
    constants : ndarray, shape (L, 3)
    back, weight : ndarray, shape (D, steps a period)
        As `delay_lookup`.
    signals : ndarray, shape (D, states)
    period_s : float
    """

    matrix: Array
    constant: Array
    ramp: Array
    grip: Array
    steps: Array
    new: Array
    step_s: Array
    place: Array
    dry: Array
    constants: Array
    back: Array
    weight: Array
    signals: Array
    period_s: float


class Memory(NamedTuple):
    """What a plant remembers between steps, changed in place.

    Attributes
    ----------
    z : ndarray, shape (size,)
        States and inputs, as `propagate.StateLayout` has them.
    mode : ndarray of int, shape (L,)
        Direction in which dry friction slides, 0 where it sticks.
    history : ndarray, shape (D, capacity)
        Signals of the delayed springs at the beginning and after every step.
    filled : ndarray of int, shape (1,)
        How many of these there are.
    """

    z: Array
    mode: Array
    history: Array
    filled: Array


def tables(plant: Plant, period_s: float, substeps: int, halvings: int) -> Tables:
    """What `stepper_kernel.run` needs to know of a plant.

    Parameters
    ----------
    plant : Plant
    period_s : float
        Sampling period, s.
    substeps : int
        Steps a period, at least.
    halvings : int
        How often a step may be halved.

    Raises
    ------
    InputError
        For a delayed spring whose delay is shorter than a step.
    """
    parts = stretches(plant.delay_s, period_s, substeps)
    found = [[_step(plant, part.step_s / 2**h) for h in range(halvings + 1)] for part in parts]
    matrix, constant, ramp, grip = (
        np.array([[step[i] for step in row] for row in found]) for i in range(4)
    )
    lookup = [delay_lookup(parts, period_s, spring.delay_s) for spring in plant.delayed]
    pieces = sum(part.steps for part in parts)
    entries = np.array(lookup).reshape(len(lookup), pieces, 2)
    constants = np.zeros((len(plant.laws), 3))
    for j, law in enumerate(plant.laws):
        constants[j, : len(law.constants)] = law.constants
    return Tables(
        matrix,
        constant,
        ramp,
        grip,
        np.array([part.steps for part in parts]),
        np.array([part.new for part in parts]),
        np.array([part.step_s for part in parts]),
        np.array([_place(motion) for motion in plant.law_motion], int).reshape(-1, 4),
        np.array([law.dry for law in plant.laws], bool),
        constants,
        np.ascontiguousarray(entries[:, :, 0]).astype(int),
        np.ascontiguousarray(entries[:, :, 1]),
        np.ascontiguousarray(plant.delayed_signals),
        period_s,
    )


def _step(plant: Plant, length_s: float) -> tuple[Array, Array, Array, Array]:
    """Matrix, constant, ramp and grip of a step of one length."""
    at, small = layout(plant), generator(plant)
    size, n, laws = at.size, at.states, at.laws
    wide = np.zeros((size + laws, size + laws))
    wide[:size, :size] = small
    for j in range(laws):
        wide[at.first_law + j, size + j] = 1 / length_s
    power = scipy.linalg.expm(wide * length_s)
    constant = power[:size, at.first_law : at.first_delayed].copy()
    constant[n:] = 0
    ramp = power[:size, size:].copy()
    ramp[n:] = 0
    grip = np.einsum("jn,nj->j", plant.law_motion[:, 1], constant[:n])
    return power[:size, :size], constant.T, ramp.T, grip


def _place(motion: Array) -> list[int]:
    """A row of `Tables.place`: where position and velocity of a law are in the state."""
    found = []
    for row in motion:
        minus = np.flatnonzero(row < 0)
        found += [int(np.argmax(row)), int(minus[0]) if len(minus) else -1]
    return found


def delay_lookup(
    parts: tuple[Stretch, ...], period_s: float, delay_s: float
) -> list[tuple[int, float]]:
    """For the end of each step: where its time less the delay lies between the step boundaries.

    Parameters
    ----------
    parts : tuple of Stretch
        The period.
    period_s, delay_s : float
        Sampling period and delay of the spring, s.

    Returns
    -------
    list of tuple
        (how many boundaries before the step's beginning, weight of the boundary after that one).

    Raises
    ------
    InputError
        For a delay that is shorter than a step.
    """
    steps = [part.step_s for part in parts for _ in range(part.steps)]
    if delay_s < max(steps):
        raise InputError(
            f"a delayed spring's delay of {delay_s:g} s is shorter than a step of "
            f"{max(steps):g} s; use a longer delay or more substeps"
        )
    ends = np.cumsum(steps)
    ends[-1] = period_s
    count = len(steps)
    lookup = []
    for piece, end in enumerate(ends):
        time = end - delay_s
        period = math.floor(time / period_s + 1e-12)
        inside = max(time - period * period_s, 0.0)
        after = min(int(np.searchsorted(ends, inside, side="right")), count - 1)
        start = ends[after - 1] if after else 0.0
        boundary = period * count + after
        lookup.append((piece - boundary, float((inside - start) / steps[after])))
    return lookup
