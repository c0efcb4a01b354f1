"""Gravity on a part that turns: a pendulum's torque."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from bayeshaptic.effects.nonlinear.internal_force import MOTOR, Law, Place
from bayeshaptic.effects.nonlinear.protocol import Floats, Motion, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import POSITION, Shape, Usual
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import device_mass
from bayeshaptic.models import Model

_TURN = 2 * math.pi
# Rms of the motion, rad, below which the sine differs from a spring by under a part in 600.
_SMALLEST = 0.1
_SLOW_HZ = np.array([0.3, 0.6, 1.2, 2.5])  # of the pendulum that it makes of the device


@register
class Gravity(NonlinearEffect):
    """A torque -m g l sin(angle), the angle counted from where the part hangs.

    Small motions see a spring of m g l cos(angle), the effect `centring_stiffness`; only a motion
    of some tenths of a radian tells gravity from that.
    """

    name = "gravity"
    title = "gravity on a part that turns"
    over = (POSITION,)
    strength = ("gravity_torque", "force")
    dimensions = {"hangs_at": "position"}
    tuned = ("hangs_at",)
    most: ClassVar[Mapping[str, float]] = {"hangs_at": _TURN}
    ties = ("hardening_spring", "centring_stiffness")
    told_apart_by = "turn the device by a quarter of a turn and record again: gravity turns along"

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        turns = model.position_unit == "rad" and MOTOR in motion
        if not turns or motion[MOTOR].position.std() < _SMALLEST:
            return ()
        angles = _TURN * (np.arange(8) + 0.5) / 8
        return tuple(cls(MOTOR, {"hangs_at": float(angle)}) for angle in angles)

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        if place != MOTOR or usual.x != "rad" or usual.position < _SMALLEST:
            return ()
        title = "gravity {where}, with the"
        return (
            Shape("gravity_sine", f"{title} sine of the angle", POSITION, _sine),
            Shape("gravity_cosine", f"{title} cosine of the angle", POSITION, _cosine),
        )

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return np.asarray(device_mass(model, theta) * (_TURN * _SLOW_HZ) ** 2)

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(_pendulum, (strength, self.shape["hangs_at"]))


def _pendulum(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    return -constants[0] * math.sin(x - constants[1])


def _sine(x: Floats) -> Floats:
    return -np.sin(x)


def _cosine(x: Floats) -> Floats:
    return -np.cos(x)
