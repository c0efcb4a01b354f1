"""Dry friction at the motor: Coulomb's law, Stribeck's, Dahl's; and drag."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayeshaptic.effects.internal_force import MOTOR, Law, Place
from bayeshaptic.effects.nonlinear import Floats, Motion, NonlinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.models import Model

_BY_VELOCITY = ("sign(v)", "v|v|", "v^3")


def _force_scale(model: Model, theta: Floats, motion: Motion) -> float:
    """The force that viscous damping of the motion would take: what friction hides as."""
    values = dict(zip(model.names, theta, strict=True))
    mass = values.get("m", values.get("m1", 0.0) + values.get("m2", 0.0))
    return float(mass * motion.velocity.std() * 2 * np.pi * 3.0)


@register
class CoulombFriction(NonlinearEffect):
    """A force of constant size against the motion; it sticks where that holds the mass still."""

    name = "coulomb_friction"
    title = "dry (Coulomb) friction"
    columns = _BY_VELOCITY
    strength = ("friction_force", "force")

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return (cls(),)

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return _force_scale(model, theta, motion) * np.array([0.003, 0.01, 0.03, 0.1, 0.3])

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        def force(position: Floats, velocity: Floats, gain: float) -> Floats:
            return np.minimum(np.maximum(velocity * (-1 / gain), -strength), strength)

        return force


@register
class StribeckFriction(NonlinearEffect):
    """Dry friction that falls from a larger static value as the velocity grows.

    Bound Fc (1 + (rise - 1) exp(-(v/vs)^2)); R. Stribeck, 1902.
    """

    name = "stribeck_friction"
    title = "dry friction that falls with velocity (Stribeck)"
    columns = _BY_VELOCITY
    strength = ("friction_force", "force")
    dimensions = {"static_over_moving": "number", "stribeck_velocity": "velocity"}

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        usual = float(motion[MOTOR].velocity.std())
        return tuple(
            cls(MOTOR, {"static_over_moving": rise, "stribeck_velocity": share * usual})
            for rise in (1.35, 1.8)
            for share in (0.05, 0.25)
        )

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return _force_scale(model, theta, motion) * np.array([0.003, 0.01, 0.03, 0.1, 0.3])

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        rise = self.shape["static_over_moving"] - 1
        scale = 1 / self.shape["stribeck_velocity"]

        def force(position: Floats, velocity: Floats, gain: float) -> Floats:
            bound = strength * (1 + rise * np.exp(-((velocity * scale) ** 2)))
            return np.minimum(np.maximum(velocity * (-1 / gain), -bound), bound)

        return force


@register
class Drag(NonlinearEffect):
    """A force against the motion that grows with the square of the velocity."""

    name = "drag"
    title = "drag that grows with the square of the velocity"
    columns = _BY_VELOCITY
    strength = ("drag_coefficient", "drag")

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return (cls(),)

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        scale = _force_scale(model, theta, motion) / motion.velocity.std() ** 2
        return scale * np.array([0.003, 0.01, 0.03, 0.1, 0.3])

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        def force(position: Floats, velocity: Floats, gain: float) -> Floats:
            resistance = strength * np.abs(velocity)
            return -resistance * velocity / (1 + resistance * gain)  # implicit: never reverses

        return force
