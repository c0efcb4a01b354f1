"""Periods of a plant, compiled: the plain form is `tests/references/plain_bench_stepper.py`."""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel

_CORRECTIONS = 2
"""How often the force at the end of a step is looked up again where the step then ends."""


@kernel(exact=True)
def run(tables, forces, memory, acting, hand, states):  # type: ignore[no-untyped-def]
    """Take periods and note the state at the beginning of each; see `Stepper.run`."""
    z, mode, n = memory.z, memory.mode, states.shape[1]
    end, modes, applied = np.empty_like(z), np.zeros_like(mode), np.empty(len(mode))
    finest = tables.matrix.shape[1] - 1
    pending = np.empty(finest + 2, np.int64)
    places, dry, constants = tables.place, tables.dry, tables.constants
    smooth = not np.all(dry)
    for k in range(len(states)):
        states[k] = z[:n]
        z[n + 1] = hand[k]
        z[n + 2] = (hand[k + 1] - hand[k]) / tables.period_s
        piece = 0
        for part in range(len(tables.steps)):
            z[n] = acting[k + 1] if tables.new[part] else acting[k]
            for _ in range(tables.steps[part]):
                if len(tables.back):
                    _set_delayed(tables, memory, n, piece, tables.step_s[part])
                # A step, or its halves where friction reverses in it, and so on.
                pending[0] = 0
                left = 1
                while left:
                    left -= 1
                    level = pending[left]
                    _predict(tables.matrix, part, level, z, end)
                    if smooth:
                        ramp = tables.ramp[part, level]
                        _bend(places, dry, constants, forces, ramp, n, z, end, applied)
                    done = True
                    for j in range(len(dry)):
                        if dry[j] and done:
                            done = _rub(tables, part, level, j, n, z, mode, end, modes)
                    if done:
                        _slide(places, dry, constants, n, end, modes)
                        if smooth:
                            _settle(places, dry, constants, forces, n, z, end)
                        z[:] = end
                        mode[:] = modes
                    else:
                        pending[left : left + 2] = level + 1
                        left += 2
                if len(tables.back):
                    _remember(tables, memory)
                piece += 1


# Arrays whole, with where to look in them: a view of a part, which counts who uses it, costs a
# tenth of a step.
@kernel(inline=True, exact=True)
def _predict(matrix, part, level, z, end):  # type: ignore[no-untyped-def]
    """The end of a step with the forces of its beginning."""
    for i in range(len(end)):
        total = 0.0
        for j in range(len(z)):
            total += matrix[part, level, i, j] * z[j]
        end[i] = total


@kernel(inline=True, exact=True)
def _bend(places, dry, constants, forces, ramp, n, z, end, applied):  # type: ignore[no-untyped-def]
    """Correct it by the smooth forces there."""
    for j in range(len(dry)):
        applied[j] = z[n + 3 + j]
    for _ in range(_CORRECTIONS):
        for j in range(len(dry)):
            if not dry[j]:
                force = _smooth(places, constants, j, forces[j], n + 3 + j, z, end)
                for i in range(n):
                    end[i] += ramp[j, i] * (force - applied[j])
                applied[j] = force


@kernel(inline=True, exact=True)
def _rub(tables, part, level, j, n, z, mode, end, modes):  # type: ignore[no-untyped-def]
    """Add dry friction to the end of a step; False where it begins, ends or turns in it.

    What it does from then on goes to `modes`.
    """
    place, constants, slot = tables.place, tables.constants, n + 3 + j
    constant, ramp, grip = tables.constant, tables.ramp, tables.grip[part, level, j]
    finest = level == tables.matrix.shape[1] - 1
    before, static, way = z[slot], constants[j, 1], mode[j]
    v = _at(end, place, j, 2)
    if way and v * way > 0:
        if static != constants[j, 0]:
            force = -way * _sliding(v, constants, j)
            for i in range(len(end)):
                end[i] += ramp[part, level, j, i] * (force - before)
        modes[j] = way
        return True
    if way and not finest:
        return False
    # What the velocity would gain in the step without this friction decides if it can hold.
    start = _at(z, place, j, 2) if way else 0.0
    gain = v - before * grip - start
    sticks = abs(gain) <= static * grip
    if not sticks and not finest:
        return False
    if sticks:
        force = -(gain + start) / grip
    elif way:
        force = before * (2 * start / (start - v) - 1)
    else:
        force = -math.copysign(static, gain)
    for i in range(len(end)):
        end[i] += constant[part, level, j, i] * (force - before)
    if not sticks:
        modes[j] = int(math.copysign(1.0, gain))
        return True
    modes[j] = 0
    end[slot] = force
    if place[j, 3] < 0:
        # A mass that stuck stands still: nothing is left of what rounding and the step moved.
        end[place[j, 2]] = 0.0
        if way == 0:
            end[place[j, 0]] = z[place[j, 0]]
    return True


@kernel(inline=True, exact=True)
def _slide(places, dry, constants, n, end, modes):  # type: ignore[no-untyped-def]
    """Friction where it slides at the end of the step."""
    for j in range(len(dry)):
        if dry[j] and modes[j]:
            v = _at(end, places, j, 2)
            end[n + 3 + j] = -modes[j] * _sliding(v, constants, j)


@kernel(inline=True, exact=True)
def _settle(places, dry, constants, forces, n, z, end):  # type: ignore[no-untyped-def]
    """The smooth forces that the next step begins with."""
    for j in range(len(dry)):
        if not dry[j]:
            end[n + 3 + j] = _smooth(places, constants, j, forces[j], n + 3 + j, z, end)


@kernel(inline=True, exact=True)
def _smooth(place, constants, j, force, slot, z, end):  # type: ignore[no-untyped-def]
    """The force of a smooth law at the end of a step."""
    q, v = _at(end, place, j, 0), _at(end, place, j, 2)
    return force(q, v, z[slot], q - _at(z, place, j, 0), constants[j].ctypes)


@kernel(inline=True, exact=True)
def _sliding(v, constants, j):  # type: ignore[no-untyped-def]
    """Size of the sliding force of dry friction."""
    level, static = constants[j, 0], constants[j, 1]
    if static == level:
        return level
    return level + (static - level) * math.exp(-((v / constants[j, 2]) ** 2))


@kernel(inline=True, exact=True)
def _at(z, place, j, first):  # type: ignore[no-untyped-def]
    """A relative position (first = 0) or velocity (2)."""
    taken = z[place[j, first + 1]] if place[j, first + 1] >= 0 else 0.0
    return z[place[j, first]] - taken


@kernel(inline=True, exact=True)
def _set_delayed(tables, memory, n, piece, length_s):  # type: ignore[no-untyped-def]
    """The forces of the delayed springs over the step to come, as straight lines."""
    springs, filled = len(tables.back), memory.filled[0]
    first = n + 3 + len(tables.dry)
    for j in range(springs):
        last = filled - 1 - tables.back[j, piece]
        early = memory.history[j, last] if last >= 0 else 0.0
        late = memory.history[j, min(last + 1, filled - 1)] if last + 1 >= 0 else 0.0
        target = early + tables.weight[j, piece] * (late - early)
        memory.z[first + springs + j] = (target - memory.z[first + j]) / length_s


@kernel(inline=True, exact=True)
def _remember(tables, memory):  # type: ignore[no-untyped-def]
    for j in range(len(tables.signals)):
        signal = 0.0
        for i in range(tables.signals.shape[1]):
            signal += tables.signals[j, i] * memory.z[i]
        memory.history[j, memory.filled[0]] = signal
    if len(tables.signals):
        memory.filled[0] += 1
