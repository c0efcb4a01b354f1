"""Actuators that do not give what is commanded: saturation, and a dead zone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayeshaptic.effects.internal_force import Place
from bayeshaptic.effects.nonlinear import CommandEffect, Floats, Motion, NonlinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.models import Model


@register
class ActuatorSaturation(CommandEffect):
    """The actuator gives no more than its limit."""

    name = "actuator_saturation"
    title = "saturation of the actuator"
    columns = ("u^3",)
    strength = ("force_limit", "force")

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return (cls(),)

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return np.abs(motion.command).max() * np.array([0.95, 0.75, 0.55, 0.4, 0.25])

    def lost(self, strength: float, command: Floats) -> Floats:
        return command - np.clip(command, -strength, strength)


@register
class DeadZone(CommandEffect):
    """The actuator gives nothing for commands within the zone, and that much less outside it."""

    name = "dead_zone"
    title = "dead zone of the actuator"
    columns = ("u^3",)
    strength = ("half_zone", "force")

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return (cls(),)

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return motion.command.std() * np.array([0.01, 0.03, 0.1, 0.3, 0.6])

    def lost(self, strength: float, command: Floats) -> Floats:
        return np.clip(command, -strength, strength)
