"""Resistance that is no plain damper: drag, cubic damping, and a damper that changes on its way."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

import numpy as np

from bayeshaptic.effects.nonlinear.friction import FAINT_TO_STRONG, force_scale, rms_velocities
from bayeshaptic.effects.nonlinear.internal_force import MOTOR, Law, Place
from bayeshaptic.effects.nonlinear.protocol import Floats, Motion, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import ALONG, LOAD_VELOCITY, VELOCITY, Shape, Usual
from bayeshaptic.effects.registry import register
from bayeshaptic.models import Model


class _PowerOfVelocity(NonlinearEffect):
    """A force against the motion that grows with a power of the velocity."""

    over = (VELOCITY, LOAD_VELOCITY)
    power: ClassVar[int]

    also: ClassVar[tuple[int, ...]] = ()
    """Powers that have no law of their own."""

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return tuple(map(cls, rms_velocities(motion)))

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        return tuple(_resistance(power) for power in (cls.power, *cls.also))

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        scale = force_scale(model, theta, motion) / motion.velocity.std() ** self.power
        return scale * FAINT_TO_STRONG

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(_power_of_velocity, (strength, self.power))


def _power_of_velocity(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    """Implicit, so that it never reverses the motion."""
    middle, resistance = v, 0.0
    for _ in range(2):  # the second time with the velocity that the first one leaves
        resistance = constants[0]
        for _ in range(int(constants[1]) - 1):
            resistance *= abs(middle)
        middle = v / (1 + 0.5 * resistance * gain)
    return -resistance * middle


def _power(power: int) -> Callable[[Floats], Floats]:
    return lambda v: -v * np.abs(v) ** (power - 1)


def _resistance(power: int) -> Shape:
    title = f"drag {{where}} with power {power} of the velocity"
    unit = f"{{force}} ({{x}}/s)^-{power}"
    # A drag below zero would drive the motion.
    return Shape(f"drag_{power}", title, VELOCITY, _power(power), unit, positive=True)


@register
class Drag(_PowerOfVelocity):
    """A force -c v |v|, as of a turbulent fluid."""

    name = "drag"
    title = "drag that grows with the square of the velocity"
    tests = (
        Shape("v|v|", "a force like v|v|, as drag", VELOCITY, _power(2)),
        Shape("v2|v2|", "drag at the load", LOAD_VELOCITY, _power(2)),
    )
    strength = ("drag_coefficient", "drag")
    power = 2
    also = (5,)


@register
class CubicDamping(_PowerOfVelocity):
    """A force -c v^3."""

    name = "cubic_damping"
    title = "damping that grows with the cube of the velocity"
    tests = (
        Shape("v^3", "a force like v\N{SUPERSCRIPT THREE}", VELOCITY, _power(3), "cubic_damping"),
        Shape("v2^3", "cubic damping at the load", LOAD_VELOCITY, _power(3), "cubic_damping"),
    )
    strength = ("cubic_damping", "cubic_damping")
    power = 3


@register
class DampingAlongTheWay(NonlinearEffect):
    """A force -c (x - least)^2 v on the motor, as of a cable or a guide that is tighter elsewhere.

    What the linear model keeps of the damping is that where there is least of it, and so is the
    limit.  `least_at` is a share of the way that was recorded.
    """

    name = "damping_along_the_way"
    title = "damping that changes along the way"
    tests = (
        Shape("x^2 v", "damping with the square of the position", ALONG, lambda x: -(x**2)),
        Shape("x v", "damping that grows along the way", ALONG, lambda x: -x),
    )
    over = (ALONG,)
    strength = ("damping_growth", "damping_growth")
    dimensions: ClassVar[Mapping[str, str]] = {
        "least_at": "number",
        "way_begins": "position",
        "way_length": "position",
    }
    tuned = ("least_at",)
    most: ClassVar[Mapping[str, float]] = {"least_at": 1.0}

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        position = motion[MOTOR].position
        way = {"way_begins": float(position.min()), "way_length": float(np.ptp(position))}
        return tuple(cls(MOTOR, {"least_at": share, **way}) for share in (0.1, 0.3, 0.5, 0.7, 0.9))

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        away = motion.position - self._least
        scale = force_scale(model, theta, motion) / motion.velocity.std()
        return scale / np.mean(away**2) * FAINT_TO_STRONG

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(_along_the_way, (strength, self._least))

    @property
    def _least(self) -> float:
        """Where there is least of it."""
        return self.shape["way_begins"] + self.shape["least_at"] * self.shape["way_length"]


def _along_the_way(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    """Implicit, so that it never reverses the motion."""
    away = x - constants[1]
    resistance = constants[0] * away * away
    return -resistance * v / (1 + 0.5 * resistance * gain)
