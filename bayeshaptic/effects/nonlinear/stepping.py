"""Steps of a linear mechanism with a force that its motion makes: the plain form, a reference.

`stepping_kernel` is the same compiled; the two are tested to agree.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayeshaptic.types import Floats


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
        The force of a step, as `Law.force`.
    constants : ndarray
        Of the law: its strength and shape.

    Returns
    -------
    ndarray, shape (N,)
    """
    states = len(drive)
    z, force = np.zeros(states), 0.0
    position, velocity = np.append(position, position[-1:]), np.append(velocity, velocity[-1:])
    motor = []
    for k in range(len(position) - 1):
        if k % substeps == 0:
            motor.append(float(reading @ z))
        ahead = matrix @ z
        x = ahead[states] + 0.5 * (position[k] + position[k + 1])
        v = ahead[states + 1] + 0.5 * (velocity[k] + velocity[k + 1])
        last = ahead[states + 2] + velocity[k + 1]
        force = law(x, v, last, gain, force, step_s, constants)
        z = ahead[:states] + drive * force
    return np.array(motor)
