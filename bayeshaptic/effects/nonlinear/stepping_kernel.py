"""Steps of a linear mechanism with a force that its motion makes, compiled.

`tests/plain_stepping.py` is the same in plain NumPy.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats


@kernel
def step_through(
    matrix: Floats,
    drive: Floats,
    gain: float,
    reading: Floats,
    position: Floats,
    velocity: Floats,
    step_s: float,
    substeps: int,
    law: Callable[..., float],
    constants: Floats,
) -> Floats:
    """What a force adds to the motor's position at the samples, from rest.

    Parameters
    ----------
    matrix : ndarray, shape (S + 3, S)
        One step of the S states without the force; then what it adds to position and velocity in
        the middle of the step, and to the velocity at its end.
    drive : ndarray, shape (S,)
        What a unit force held over the step adds to the states.
    gain : float
        What it adds to the velocity.
    reading : ndarray, shape (S,)
        The motor's position in the states.
    position, velocity : ndarray, shape (N * substeps,)
        Motion at the force's place without the force.
    step_s : float
    substeps : int
    law : callable
        The force of a step, as `Law.force`: a compiled callback.
    constants : ndarray
        Of the law: its strength and shape.

    Returns
    -------
    ndarray, shape (N,)
    """
    states = matrix.shape[1]
    motor = np.empty(len(position) // substeps)
    z, ahead = np.zeros(states), np.empty(states)
    force = 0.0
    for sample in range(len(motor)):
        read = 0.0
        for i in range(states):
            read += reading[i] * z[i]
        motor[sample] = read
        for k in range(sample * substeps, (sample + 1) * substeps):
            x, v, last = 0.0, 0.0, 0.0  # first, and in registers: the law waits for them
            for i in range(states):
                x += matrix[states, i] * z[i]
                v += matrix[states + 1, i] * z[i]
                last += matrix[states + 2, i] * z[i]
            for j in range(states):
                total = 0.0
                for i in range(states):
                    total += matrix[j, i] * z[i]
                ahead[j] = total
            after = min(k + 1, len(position) - 1)
            x += 0.5 * (position[k] + position[after])
            v += 0.5 * (velocity[k] + velocity[after])
            last += velocity[after]
            force = law(x, v, last, gain, force, step_s, constants)
            for i in range(states):
                z[i] = ahead[i] + drive[i] * force
    return motor
