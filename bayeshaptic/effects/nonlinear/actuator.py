"""Actuators that do not give what is commanded.

Saturation, hard or gradual, a dead zone, and one that gives less one way than the other.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, Floats, Motion, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import COMMAND, Shape
from bayeshaptic.effects.registry import register
from bayeshaptic.models import Model

_CUBE = Shape(
    "u^3",
    "a command that acts like u\N{SUPERSCRIPT THREE}, as saturation",
    COMMAND,
    lambda u: -(u**3),
)
_EVEN = Shape("|u|", "a command that acts like |u|, more one way than the other", COMMAND, np.abs)


@register
class ActuatorSaturation(CommandEffect):
    """The actuator gives no more than its limit."""

    name = "actuator_saturation"
    title = "saturation of the actuator"
    tests = (_CUBE,)
    over = (COMMAND,)
    strength = ("force_limit", "force")

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return np.abs(motion.command).max() * np.array([0.95, 0.75, 0.55, 0.4, 0.25])

    def lost(self, strength: float, command: Floats) -> Floats:
        return command - np.clip(command, -strength, strength)


@register
class SoftSaturation(CommandEffect):
    """The actuator's force approaches its limit L gradually: u / (1 + |u/L|^p)^(1/p).

    C. Rapp, 2nd European Conf. on Satellite Communications, 1991. The larger the sharpness p, the
    harder the limit; u is given in full where it is small.
    """

    name = "soft_saturation"
    title = "gradual saturation of the actuator"
    tests = (_CUBE,)
    over = (COMMAND,)
    strength = ("force_limit", "force")
    dimensions = {"sharpness": "number"}
    tuned = ("sharpness",)

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return (cls(shape={"sharpness": 2.5}),)

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return np.abs(motion.command).max() * np.array([2.0, 1.0, 0.6, 0.35])

    def lost(self, strength: float, command: Floats) -> Floats:
        sharpness = self.shape["sharpness"]
        # log(1 + r^p)/p without overflow for a sharp limit.
        with np.errstate(divide="ignore"):
            bend = np.logaddexp(0.0, sharpness * np.log(np.abs(command) / strength)) / sharpness
        return command * -np.expm1(-bend)


@register
class DeadZone(CommandEffect):
    """The actuator gives nothing for commands within the zone, and that much less outside it."""

    name = "dead_zone"
    title = "dead zone of the actuator"
    tests = (_CUBE,)
    over = (COMMAND,)
    strength = ("half_zone", "force")

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return motion.command.std() * np.array([0.01, 0.03, 0.1, 0.3, 0.6])

    def lost(self, strength: float, command: Floats) -> Floats:
        return np.clip(command, -strength, strength)


@register
class UnevenActuator(CommandEffect):
    """The actuator gives less of the commands of one sign than of those of the other.

    As the two sides of a cylinder's piston do, or two halves of an amplifier.  The stronger way is
    given in full, so that the limit is that of a wall which is pushed against that way.
    """

    name = "uneven_actuator"
    title = "an actuator that is weaker one way"
    tests = (_EVEN,)
    over = (COMMAND,)
    strength = ("weaker_below_zero_by", "number")
    signed = True  # where it is negative it is the commands above zero that are given in part

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return np.array([0.01, 0.03, 0.1, 0.3])

    def lost(self, strength: float, command: Floats) -> Floats:
        weaker = np.minimum(command, 0.0) if strength > 0 else np.maximum(command, 0.0)
        return abs(strength) * weaker
