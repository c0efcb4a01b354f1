"""Steps of a linear mechanism with forces that its motion makes, compiled.

`tests/plain_stepping.py` is the same in plain NumPy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats


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


@kernel
def step_through(
    matrix: Floats,
    rows: Floats,
    drive: Floats,
    gains: Floats,
    reading: Floats,
    motion: Floats,
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
    motion : ndarray, shape (F, 2, N * substeps)
        Position and velocity at each force's place without forces.
    step_s : float
    substeps : int
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
    steps = motion.shape[2]
    motor = np.empty((count, steps // substeps))
    z, ahead = np.zeros((count, states)), np.empty((count, states))
    force = np.zeros(count)
    for sample in range(motor.shape[1]):
        for f in range(count):
            read = 0.0
            for i in range(states):
                read += reading[i] * z[f, i]
            motor[f, sample] = read
        for k in range(sample * substeps, (sample + 1) * substeps):
            for f in range(count):
                for j in range(states):
                    total = 0.0
                    for i in range(states):
                        total += matrix[j, i] * z[f, i]
                    ahead[f, j] = total
            after = min(k + 1, steps - 1)
            for f in range(count):
                x, v, last = 0.0, 0.0, 0.0  # in registers: the law waits for them
                for g in range(count):
                    for i in range(states):
                        x += rows[f, 0, i] * z[g, i]
                        v += rows[f, 1, i] * z[g, i]
                        last += rows[f, 2, i] * z[g, i]
                for g in range(f):
                    x += gains[f, g, 0] * force[g]
                    v += gains[f, g, 1] * force[g]
                    last += gains[f, g, 2] * force[g]
                x += 0.5 * (motion[f, 0, k] + motion[f, 0, after])
                v += 0.5 * (motion[f, 1, k] + motion[f, 1, after])
                last += motion[f, 1, after]
                gain, before = gains[f, f, 2], force[f]
                if f == 0:  # a view costs a tenth of the step
                    force[f] = laws[f](x, v, last, gain, before, step_s, constants)
                else:
                    own = constants[begins[f] :]
                    force[f] = laws[f](x, v, last, gain, before, step_s, own)
                if sticks[f]:
                    force[f] = rubbing(2 * v - last, last, gain, force[f])
            for f in range(count):
                for i in range(states):
                    z[f, i] = ahead[f, i] + drive[f, i] * force[f]
    return motor
