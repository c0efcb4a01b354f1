"""Steps of a mechanism with a force that its motion makes, in plain NumPy: a reference."""

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
    """As `stepping_kernel.step_through`; `law` is any function."""
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
