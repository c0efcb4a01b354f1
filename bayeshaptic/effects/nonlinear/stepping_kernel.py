"""The compiled form of `stepping.step_through`."""

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
    """As the plain form; `law` is a compiled callback."""
    rows, states = matrix.shape
    motor = np.empty(len(position) // substeps)
    z, ahead = np.zeros(states), np.empty(rows)
    force = 0.0
    for sample in range(len(motor)):
        read = 0.0
        for i in range(states):
            read += reading[i] * z[i]
        motor[sample] = read
        for k in range(sample * substeps, (sample + 1) * substeps):
            for j in range(rows):
                total = 0.0
                for i in range(states):
                    total += matrix[j, i] * z[i]
                ahead[j] = total
            after = min(k + 1, len(position) - 1)
            x = ahead[states] + 0.5 * (position[k] + position[after])
            v = ahead[states + 1] + 0.5 * (velocity[k] + velocity[after])
            last = ahead[states + 2] + velocity[after]
            force = law(x, v, last, gain, force, step_s, constants)
            for i in range(states):
                z[i] = ahead[i] + drive[i] * force
    return motor
