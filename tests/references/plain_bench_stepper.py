"""Periods of a plant of the bench in plain Python: the reference of `stepper_kernel`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from bayeshaptic.rig.dynamics.laws import sliding
from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.dynamics.step_tables import Memory, Tables
from bayeshaptic.rig.dynamics.stepper import Stepper

_CORRECTIONS = 2
_POSITION, _VELOCITY = 0, 2

Forces = Sequence[Callable[..., float] | None]  # of dry friction none


def plainly(stepper: Stepper, acting: Array, hand: Array) -> Array:
    """`Stepper.run`, step by step in Python."""
    states = np.empty((len(acting) - 1, stepper.plant.states))
    stepper._make_room(len(states) * int(stepper.tables.steps.sum()))
    forces = [getattr(law, "force", None) for law in stepper.plant.laws]
    _run(stepper.tables, forces, stepper.memory, acting, hand, states)
    return states


def _run(
    tables: Tables, forces: Forces, memory: Memory, acting: Array, hand: Array, states: Array
) -> None:
    """Take periods and note the state at the beginning of each."""
    z, n = memory.z, states.shape[1]
    for k in range(len(states)):
        states[k] = z[:n]
        z[n + 1] = hand[k]
        z[n + 2] = (hand[k + 1] - hand[k]) / tables.period_s
        piece = 0
        for part, steps in enumerate(tables.steps):
            z[n] = acting[k + 1] if tables.new[part] else acting[k]
            for _ in range(steps):
                _set_delayed(tables, memory, piece, tables.step_s[part])
                _take(tables, forces, memory, part, 0)
                _remember(tables, memory)
                piece += 1


def _take(tables: Tables, forces: Forces, memory: Memory, part: int, level: int) -> None:
    """A step, or its two halves where friction reverses in it."""
    z, first = memory.z, tables.signals.shape[1] + 3
    end = tables.matrix[part, level] @ z
    smooth, dry = (np.flatnonzero(tables.dry == which).tolist() for which in (False, True))

    def force(j: int) -> float:
        q = _at(end, tables.place[j], _POSITION)
        moved = q - _at(z, tables.place[j], _POSITION)
        v = _at(end, tables.place[j], _VELOCITY)
        law = forces[j]
        assert law is not None
        return law(q, v, z[first + j], moved, tables.constants[j])

    applied = z[first:].copy()
    for _ in range(_CORRECTIONS):
        for j in smooth:
            found = force(j)
            end += tables.ramp[part, level, j] * (found - applied[j])
            applied[j] = found
    modes = [_rub(tables, memory, end, part, level, j) for j in dry]
    if None in modes:
        _take(tables, forces, memory, part, level + 1)
        _take(tables, forces, memory, part, level + 1)
        return
    memory.mode[dry] = modes
    for j in dry:
        if memory.mode[j]:
            v = _at(end, tables.place[j], _VELOCITY)
            end[first + j] = -memory.mode[j] * sliding(v, tables.constants[j])
    for j in smooth:
        end[first + j] = force(j)
    z[:] = end


def _rub(tables: Tables, memory: Memory, end: Array, part: int, level: int, j: int) -> int | None:
    """Add dry friction to the end of a step; None where one begins, ends or turns in it.

    Returns the direction in which it slides from then on, 0 where it sticks.
    """
    slot, place, mode = tables.signals.shape[1] + 3 + j, tables.place[j], int(memory.mode[j])
    level_force, static, _ = tables.constants[j]
    before, grip = memory.z[slot], tables.grip[part, level, j]
    finest = level == tables.matrix.shape[1] - 1
    v = _at(end, place, _VELOCITY)
    if mode and v * mode > 0:
        if static != level_force:
            end += tables.ramp[part, level, j] * (-mode * sliding(v, tables.constants[j]) - before)
        return mode
    if mode and not finest:
        return None
    # What the velocity would gain in the step without this friction decides if it can hold.
    start = _at(memory.z, place, _VELOCITY) if mode else 0.0
    gain = v - before * grip - start
    sticks = abs(gain) <= static * grip
    if not sticks and not finest:
        return None
    if sticks:
        force = -(gain + start) / grip
    elif mode:
        force = before * (2 * start / (start - v) - 1)
    else:
        force = -math.copysign(static, gain)
    end += tables.constant[part, level, j] * (force - before)
    end[slot] = force
    if not sticks:
        return int(math.copysign(1, gain))
    if place[3] < 0:  # a mass that stuck stands still: nothing is left of what the step moved
        end[place[2]] = 0.0
        if mode == 0:
            end[place[0]] = memory.z[place[0]]
    return 0


def _at(z: Array, place: Array, first: int) -> float:
    """A relative position or velocity."""
    return float(z[place[first]] - (z[place[first + 1]] if place[first + 1] >= 0 else 0.0))


def _set_delayed(tables: Tables, memory: Memory, piece: int, length_s: float) -> None:
    """The forces of the delayed springs over the step to come, as straight lines."""
    springs, filled = len(tables.back), int(memory.filled[0])
    first = tables.signals.shape[1] + 3 + len(tables.dry)
    for j, history in enumerate(memory.history):
        last = filled - 1 - tables.back[j, piece]
        early = history[last] if last >= 0 else 0.0
        late = history[min(last + 1, filled - 1)] if last + 1 >= 0 else 0.0
        target = early + tables.weight[j, piece] * (late - early)
        memory.z[first + springs + j] = (target - memory.z[first + j]) / length_s


def _remember(tables: Tables, memory: Memory) -> None:
    if len(tables.signals):
        signals = tables.signals @ memory.z[: tables.signals.shape[1]]
        memory.history[:, memory.filled[0]] = signals
        memory.filled[0] += 1
