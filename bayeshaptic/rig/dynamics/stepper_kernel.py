"""Periods of a plant, compiled: the plain form in the same words is `stepper_plain`."""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel

_CORRECTIONS = 2
"""How often the force at the end of a step is looked up again where the step then ends."""


@kernel(exact=True)
def run(tables, forces, memory, acting, hand, states):  # type: ignore[no-untyped-def]
    """Take periods and note the state at the beginning of each; see `Stepper.run`."""
    z, n = memory.z, states.shape[1]
    end, modes, applied = np.empty_like(z), np.empty_like(memory.mode), np.empty(len(memory.mode))
    finest = tables.matrix.shape[1] - 1
    pending = np.empty(finest + 2, np.int64)
    for k in range(len(states)):
        states[k] = z[:n]
        z[n + 1] = hand[k]
        z[n + 2] = (hand[k + 1] - hand[k]) / tables.period_s
        piece = 0
        for part in range(len(tables.steps)):
            z[n] = acting[k + 1] if tables.new[part] else acting[k]
            for _ in range(tables.steps[part]):
                _set_delayed(tables, memory, n, piece, tables.step_s[part])
                # A step, or its halves where friction reverses in it, and so on.
                pending[0] = 0
                left = 1
                while left:
                    left -= 1
                    level = pending[left]
                    if _take(tables, forces, memory, n, part, level, end, modes, applied):
                        z[:] = end
                        memory.mode[:] = modes
                    else:
                        pending[left : left + 2] = level + 1
                        left += 2
                _remember(tables, memory)
                piece += 1


@kernel(inline=True, exact=True)
def _take(tables, forces, memory, n, part, level, end, modes, applied):  # type: ignore[no-untyped-def]
    """Step to `end` with the new `modes`; False where the step must be halved."""
    z, first, count = memory.z, n + 3, len(modes)
    matrix, ramp = tables.matrix[part, level], tables.ramp[part, level]
    for i in range(len(end)):
        end[i] = 0.0
        for j in range(len(z)):
            end[i] += matrix[i, j] * z[j]
    for j in range(count):
        applied[j] = z[first + j]
        modes[j] = 0
    for _ in range(_CORRECTIONS):
        for j in range(count):
            if not tables.dry[j]:
                force = _smooth(tables, forces, z, end, first, j)
                for i in range(n):
                    end[i] += ramp[j, i] * (force - applied[j])
                applied[j] = force
    for j in range(count):
        if tables.dry[j] and not _rub(tables, memory, n, part, level, end, modes, j):
            return False
    for j in range(count):
        if tables.dry[j] and modes[j]:
            end[first + j] = -modes[j] * _sliding(_at(end, tables.place[j], 2), tables, j)
    for j in range(count):
        if not tables.dry[j]:
            end[first + j] = _smooth(tables, forces, z, end, first, j)
    return True


@kernel(inline=True, exact=True)
def _rub(tables, memory, n, part, level, end, modes, j):  # type: ignore[no-untyped-def]
    """Add dry friction to the end of a step; False where one begins, ends or turns in it."""
    z, mode, place = memory.z, memory.mode[j], tables.place[j]
    before, grip = z[n + 3 + j], tables.grip[part, level, j]
    finest = level == tables.matrix.shape[1] - 1
    v = _at(end, place, 2)
    if mode and v * mode > 0:
        bound, static = tables.constants[j, 0], tables.constants[j, 1]
        if static != bound:
            force = -mode * _sliding(v, tables, j)
            for i in range(n):
                end[i] += tables.ramp[part, level, j, i] * (force - before)
        modes[j] = mode
        return True
    if mode and not finest:
        return False
    # What the velocity would gain in the step without this friction decides if it can hold.
    start = _at(z, place, 2) if mode else 0.0
    gain = v - before * grip - start
    sticks = abs(gain) <= tables.constants[j, 1] * grip
    if not sticks and not finest:
        return False
    if sticks:
        force = -(gain + start) / grip
    elif mode:
        force = before * (2 * start / (start - v) - 1)
    else:
        force = -math.copysign(tables.constants[j, 1], gain)
    for i in range(n):
        end[i] += tables.constant[part, level, j, i] * (force - before)
    end[n + 3 + j] = force
    modes[j] = 0 if sticks else int(math.copysign(1.0, gain))
    if sticks and place[3] < 0:
        # A mass that stuck stands still: nothing is left of what rounding and the step moved.
        end[place[2]] = 0.0
        if mode == 0:
            end[place[0]] = z[place[0]]
    return True


@kernel(inline=True, exact=True)
def _smooth(tables, forces, z, end, first, j):  # type: ignore[no-untyped-def]
    """The force of a smooth law at the end of a step."""
    place = tables.place[j]
    q = _at(end, place, 0)
    moved = q - _at(z, place, 0)
    return forces[j](q, _at(end, place, 2), z[first + j], moved, tables.constants[j])


@kernel(inline=True, exact=True)
def _sliding(v, tables, j):  # type: ignore[no-untyped-def]
    """Size of the sliding force of dry friction."""
    level, static = tables.constants[j, 0], tables.constants[j, 1]
    if static == level:
        return level
    return level + (static - level) * math.exp(-((v / tables.constants[j, 2]) ** 2))


@kernel(inline=True, exact=True)
def _at(z, place, first):  # type: ignore[no-untyped-def]
    """A relative position (first = 0) or velocity (2)."""
    taken = z[place[first + 1]] if place[first + 1] >= 0 else 0.0
    return z[place[first]] - taken


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
