"""Steps of a mechanism with forces that its motion makes, in plain NumPy: a reference."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bayeshaptic.types import Floats


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
    sticks: Any,
    constants: Floats,
    begins: tuple[int, ...],
) -> Floats:
    """As `stepping_kernel.step_through`; `laws` are any functions."""
    z, force = np.zeros(drive.shape), np.zeros(len(drive))
    motion = np.concatenate([motion, motion[:, :, -1:]], axis=2)
    own = np.split(constants, begins[1:])
    motor = []
    for k in range(motion.shape[2] - 1):
        if k % substeps == 0:
            motor.append(z @ reading)
        position, velocity = motion[:, 0], motion[:, 1]
        middle = [0.5 * (m[:, k] + m[:, k + 1]) for m in (position, velocity)]
        seen = rows @ z.sum(axis=0) + np.stack([*middle, velocity[:, k + 1]], axis=1)
        for f, law in enumerate(laws):
            known = seen[f] + force[:f] @ gains[f, :f]
            size = law(*known, gains[f, f, 2], force[f], step_s, own[f])
            force[f] = rubbing(*known[1:], gains[f, f, 2], size) if sticks[f] else size
        z = z @ matrix.T + drive * force[:, None]
    return np.array(motor).T


def rubbing(middle: float, last: float, gain: float, bound: float) -> float:
    """Dry friction in the mean of a step: its impulse on a mass that is driven steadily."""
    start = 2 * middle - last
    way = np.sign(start or last)
    driven, held = last - start, gain * bound
    if way * last >= held:  # it slides on
        return float(-way * bound)
    if abs(driven) <= held:  # it stops
        return -last / gain
    turned = abs(start) / (held + abs(driven))  # and back, for the rest of the step
    return ((1 - turned) * (driven + way * held) - last) / gain
