"""Steps of a linear mechanism with forces that its motion makes, compiled.

`tests/references/plain_stepping.py` is the same in plain NumPy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats

_LANES = 4  # states at a time
# Numbers that an unrolled loop over vectors takes at once. A rest is taken one by one, and would be
# most of a step.
_AT_ONCE = 16


@kernel(inline=True)
def rubbing(start: float, last: float, gain: float, bound: float) -> float:
    """Dry friction of at most `bound`, in the mean of a step.

    Against the motion until that ends, within the step if it does; then it holds the mass where it
    can, or is against the motion the other way.  `start` and `last` are velocities at both ends
    without it.
    """
    way = start if start != 0.0 else last
    full = gain * bound
    if way < 0.0:
        start, last = -start, -last
    if last >= full:
        force = -bound
    elif last - start >= -full:
        force = -last / gain
    else:
        rest = 1.0 - start / (start - last + full)
        force = (rest * (last - start + full) - last) / gain
    return force if way >= 0.0 else -force


@kernel(inline=True)
def _product(a: Floats, b: Floats) -> Floats:
    """a b, of small matrices."""
    out = np.zeros((a.shape[0], b.shape[1]))
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            for k in range(a.shape[1]):
                out[i, j] += a[i, k] * b[k, j]
    return out


@kernel(inline=True)
def _tables(matrix: Floats, rows: Floats, drive: Floats) -> tuple[Floats, Floats, Floats]:
    """Two steps of the states together with what is seen of them, which is known ahead then.

    So the next forces wait for one product with these, and not for sums over the states; and
    products, which are most of a step, are half as many.

    Returns
    -------
    table : ndarray, shape (S', W)
        What the states become, and what is seen of that in the next step and the one after (`rows`
        of each force), for each state before; filled up with zeros: S' to fours, W to sixteens.
    early, late : ndarray, shape (F, W)
        What a unit of each force adds, in the first of both steps and in the second.
    """
    count, _, states = rows.shape
    width = states + 6 * count
    becomes = np.zeros((width + -width % _AT_ONCE, states))
    becomes[:states] = np.eye(states)
    for f in range(count):
        seen = states + 3 * f
        becomes[seen : seen + 3] = rows[f]
        becomes[seen + 3 * count : seen + 3 * count + 3] = _product(rows[f], matrix)
    table = np.zeros((states + -states % _LANES, len(becomes)))
    table[:states] = _product(becomes, _product(matrix, matrix)).T
    late = _product(drive, becomes.T)
    early = _product(drive, _product(becomes, matrix).T)
    return table, early, late


@kernel(inline=True)
def _ahead(table: Floats, w: Floats, spare: Floats) -> None:
    """What the states, and what is seen of them, become without forces: `spare`."""
    for group in range(0, len(table), _LANES):
        a, b, c, d = w[group], w[group + 1], w[group + 2], w[group + 3]
        to_a, to_b, to_c, to_d = table[group], table[group + 1], table[group + 2], table[group + 3]
        if group == 0:
            for j in range(len(w)):
                spare[j] = (to_a[j] * a + to_b[j] * b) + (to_c[j] * c + to_d[j] * d)
        else:
            for j in range(len(w)):
                spare[j] += (to_a[j] * a + to_b[j] * b) + (to_c[j] * c + to_d[j] * d)


@kernel(inline=True)
def _ahead_six(table: Floats, w: Floats, spare: Floats) -> None:
    """`_ahead` of five or six states: all sums in one pass, and none over what is filled up."""
    a, b, c, d, e, f = w[0], w[1], w[2], w[3], w[4], w[5]
    to_a, to_b, to_c, to_d = table[0], table[1], table[2], table[3]
    to_e, to_f = table[4], table[5]
    for j in range(len(w)):
        low = (to_a[j] * a + to_b[j] * b) + (to_c[j] * c + to_d[j] * d)
        spare[j] = low + (to_e[j] * e + to_f[j] * f)


@kernel(inline=True)
def _ahead_eight(table: Floats, w: Floats, spare: Floats) -> None:
    """The same of seven or eight."""
    a, b, c, d, e, f, g, h = w[0], w[1], w[2], w[3], w[4], w[5], w[6], w[7]
    to_a, to_b, to_c, to_d = table[0], table[1], table[2], table[3]
    to_e, to_f, to_g, to_h = table[4], table[5], table[6], table[7]
    for j in range(len(w)):
        low = (to_a[j] * a + to_b[j] * b) + (to_c[j] * c + to_d[j] * d)
        spare[j] = low + ((to_e[j] * e + to_f[j] * f) + (to_g[j] * g + to_h[j] * h))


@kernel
def step_through(
    matrix: Floats,
    rows: Floats,
    drive: Floats,
    gains: Floats,
    reading: Floats,
    motion: tuple[tuple[Floats, Floats], ...],
    step_s: float,
    substeps: int,
    laws: tuple[Callable[..., float], ...],
    sticks: NDArray[np.bool_],
    constants: Floats,
    begins: tuple[int, ...],
) -> Floats:
    """What forces add to the motor's position at the samples, from rest.

    Parameters
    ----------
    matrix : ndarray, shape (S, S)
        One step of the S states without forces.
    rows : ndarray, shape (F, 3, S)
        What the states before a step make of position and velocity in its middle, and of the
        velocity at its end, at each force's place.
    drive : ndarray, shape (F, S)
        What a unit of each force, held over the step, adds to the states.
    gains : ndarray, shape (F, F, 3)
        What it adds, second, to the numbers of `rows` at a place, first.
    reading : ndarray, shape (S,)
        The motor's position in the states.
    motion : tuple of two ndarrays each, shape (N * substeps,)
        Position and velocity at each force's place without forces.
    step_s : float
    substeps : int
        An even number.
    laws : tuple of callable
        The force of a step, as `Law.force`: compiled callbacks.
    sticks : ndarray of bool, shape (F,)
        Which of them are dry friction, and give its largest size.
    constants : ndarray
        Strength and shape of all laws, one after the other.
    begins : tuple of int
        Where those of each law begin.

    Returns
    -------
    ndarray, shape (F, N)
        Of each force.
    """
    count, states = len(laws), len(matrix)
    steps = len(motion[0][0])
    motor = np.empty((count, steps // substeps))
    table, early, late = _tables(matrix, rows, drive)
    w, spare = np.zeros(late.shape), np.empty(late.shape[1])
    force, first, numbers = np.zeros(count), np.zeros(count), constants.ctypes
    # A single force is kept at hand: what has just been written is waited for when it is read.
    newest, middle, alone = 0.0, 0.0, count == 1
    six, eight = _LANES < states <= 6, len(table) == 2 * _LANES
    for sample in range(motor.shape[1]):
        for f in range(count):
            read = 0.0
            for i in range(states):
                read += reading[i] * w[f, i]
            motor[f, sample] = read
        for pair in range(sample * substeps, (sample + 1) * substeps, 2):
            for k in range(pair, pair + 2):
                after = min(k + 1, steps - 1)
                begin = states if k == pair else states + 3 * count
                for f in range(count):
                    position, velocity = motion[f]
                    x = 0.5 * (position[k] + position[after])
                    last = velocity[after]
                    v = 0.5 * (velocity[k] + last)
                    at, seen = states + 3 * f, begin + 3 * f
                    for g in range(count):
                        x += w[g, seen]
                        v += w[g, seen + 1]
                        last += w[g, seen + 2]
                        if k > pair:
                            earlier = newest if alone else first[g]
                            x += late[g, at] * earlier
                            v += late[g, at + 1] * earlier
                            last += late[g, at + 2] * earlier
                    for g in range(f):
                        x += gains[f, g, 0] * force[g]
                        v += gains[f, g, 1] * force[g]
                        last += gains[f, g, 2] * force[g]
                    gain, before = gains[f, f, 2], force[f]
                    if f == 0:  # a view costs a tenth of the step
                        force[f] = laws[f](x, v, last, gain, before, step_s, numbers)
                    else:
                        own = constants[begins[f] :].ctypes
                        force[f] = laws[f](x, v, last, gain, before, step_s, own)
                    newest = force[f]
                    if sticks[f]:
                        newest = rubbing(2 * v - last, last, gain, newest)
                    force[f] = newest
                if k == pair:
                    first[:] = force
                    middle = newest
            for f in range(count):
                if six:
                    _ahead_six(table, w[f], spare)
                elif eight:
                    _ahead_eight(table, w[f], spare)
                else:
                    _ahead(table, w[f], spare)
                a = middle if alone else first[f]
                b = newest if alone else force[f]
                for j in range(len(spare)):
                    w[f, j] = (spare[j] + early[f, j] * a) + late[f, j] * b
    return motor
