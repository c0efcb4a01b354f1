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


@register
@dataclass(frozen=True)
class Bump(Effect):
    """Something strikes the motor once: half a wave of force that nobody commanded.

    Attributes
    ----------
    force : float
        Its height, N or N m.
    begin_s, length_s : float
    """

    name: ClassVar[str] = "bump"
    above_zero: ClassVar[tuple[str, ...]] = ("length_s",)
    at_least_zero: ClassVar[tuple[str, ...]] = ("begin_s",)
    force: float = 10.0
    begin_s: float = 1.0
    length_s: float = 0.04

    @classmethod
    def typical(cls, scales: MotionScales) -> Bump:
        return cls(5 * scales.force, length_s=40 * scales.period_s)

    def command(self, force: Array, progress: Array, time_s: Array) -> Array:
        part = np.clip((time_s - self.begin_s) / self.length_s, 0, 1)
        return force + self.force * np.sin(np.pi * part)


@register
@dataclass(frozen=True)
class LostCommand(Effect):
    """For a while the command does not arrive, and the motor gives nothing.

    Attributes
    ----------
    begin_s, length_s : float
    """

    name: ClassVar[str] = "lost_command"
    at_least_zero: ClassVar[tuple[str, ...]] = ("begin_s", "length_s")
    begin_s: float = 1.0
    length_s: float = 0.2

    @classmethod
    def typical(cls, scales: MotionScales) -> LostCommand:
        return cls(length_s=200 * scales.period_s)

    def command(self, force: Array, progress: Array, time_s: Array) -> Array:
        lost = (time_s >= self.begin_s) & (time_s < self.begin_s + self.length_s)
        return np.where(lost, 0.0, force)
