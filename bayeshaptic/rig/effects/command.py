"""Effects between the commanded force and the actuator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.effects.effect import Effect, MotionScales, register


@register
@dataclass(frozen=True)
class ActuatorSaturation(Effect):
    """The actuator gives no more than +-`limit`.

    Attributes
    ----------
    limit : float
        N or N m.
    """

    name: ClassVar[str] = "actuator_saturation"
    above_zero: ClassVar[tuple[str, ...]] = ("limit",)
    limit: float = 6.0

    @classmethod
    def typical(cls, scales: MotionScales) -> ActuatorSaturation:
        return cls(1.5 * scales.force)

    def command(self, force: Array, progress: Array, time_s: Array) -> Array:
        return np.clip(force, -self.limit, self.limit)


@register
@dataclass(frozen=True)
class GainDrift(Effect):
    """The actuator's gain goes from 1 to `ratio` during the recording, as it warms up.

    Attributes
    ----------
    ratio : float
    """

    name: ClassVar[str] = "gain_drift"
    ratio: float = 0.85

    def command(self, force: Array, progress: Array, time_s: Array) -> Array:
        return force * (1 + (self.ratio - 1) * progress)
