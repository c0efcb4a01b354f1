"""Dry friction: Coulomb's law, Stribeck's, Dahl's; rising with velocity; changing along the way."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import numpy as np

from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR, Law, Place
from bayeshaptic.effects.nonlinear.protocol import Floats, Motion, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import (
    EXCESS_NOISE,
    LOAD_VELOCITY,
    POSITION,
    STRETCH,
    STRETCH_VELOCITY,
    VELOCITY,
    Shape,
    Usual,
)
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import device_mass
from bayeshaptic.models import Model

# To the ground; and where masses may rub against each other, too.
_BODIES = (MOTOR, LOAD)
_EVERYWHERE = (*_BODIES, CONNECTION)
# What friction between two masses looks like: of a hysteresis, a spring that softens.
_IN_CONNECTION = {STRETCH_VELOCITY, STRETCH}
FAINT_TO_STRONG = np.array([0.003, 0.01, 0.03, 0.1, 0.3])  # over the force scale


def force_scale(model: Model, theta: Floats, motion: Motion) -> float:
    """The force that viscous damping of the motion would take: what friction hides as.

    `theta` are the values of the linear parameters, shape (P,).
    """
    corner_hz = 3.0  # b / (2 pi m) of a usual device
    return float(device_mass(model, theta) * motion.velocity.std() * 2 * np.pi * corner_hz)


def _against(v: Floats) -> Floats:
    return -np.sign(v)


def rms_velocities(
    motion: Mapping[Place, Motion], places: Iterable[Place] = _BODIES
) -> dict[Place, float]:
    """Where something may rub, against the ground by default, and the rms velocity there."""
    return {p: float(motion[p].velocity.std()) for p in places if p in motion}


class _DryFriction(NonlinearEffect):
    """A force against the motion: one mass has one, by whichever law."""

    strength = ("friction_force", "force")
    sticks = True

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        scale = force_scale(model, theta, motion)
        if self.place == CONNECTION:  # what it hides as is the connection's own damper
            values = {**model.fixed, **dict(zip(model.names, theta, strict=True))}
            hidden = float(values["bc"] * motion.velocity.std())
            scale = max(scale, 3 * hidden)  # the strongest is nine tenths of it
        return scale * FAINT_TO_STRONG

    def called_for(self, raised: set[str]) -> bool:
        if self.place == CONNECTION:
            return bool(raised & _IN_CONNECTION)
        return super().called_for(raised)


@register
class CoulombFriction(_DryFriction):
    """A force of constant size against the motion; it sticks where that holds the mass still."""

    name = "coulomb_friction"
    title = "dry (Coulomb) friction"
    tests = (
        Shape("sign(v)", "a force like sign(v), as dry friction", VELOCITY, _against),
        Shape("sign(v2)", "dry friction at the load", LOAD_VELOCITY, _against),
        Shape("sign(v - v2)", "dry friction in the connection", STRETCH_VELOCITY, _against),
    )
    # Where it holds the mass most of the time, all that is left of it is noise.
    over = (VELOCITY, LOAD_VELOCITY, EXCESS_NOISE)

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return tuple(map(cls, rms_velocities(motion, _EVERYWHERE)))

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        if place == CONNECTION:
            return ()
        force = cls.tests[0].force
        title = f"{cls.title} {{where}}"
        return (Shape("coulomb", title, VELOCITY, force, positive=True, jumps=True),)

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(_coulomb, (strength,), sticks=True)


def _coulomb(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    return constants[0]


@register
class StribeckFriction(_DryFriction):
    """Dry friction that falls from a larger static value as the velocity grows.

    Bound Fc (1 + excess exp(-(v/vs)^2)); R. Stribeck, 1902.
    """

    name = "stribeck_friction"
    title = "dry friction that falls with velocity (Stribeck)"
    over = (VELOCITY, LOAD_VELOCITY)
    dimensions = {"static_excess": "number", "stribeck_velocity": "velocity"}
    tuned = ("static_excess", "stribeck_velocity")
    # Dry cast iron has some seven times the friction at rest, clean steel twice: no pair has more.
    most = {"static_excess": 6.0}
    plain = {"static_excess": 0.0}

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return tuple(
            cls(place, {"static_excess": rise, "stribeck_velocity": share * usual})
            for place, usual in rms_velocities(motion).items()
            for rise in (0.35, 0.8)
            for share in (0.05, 0.25)
        )

    @classmethod
    def corrections(cls, usual: Usual) -> tuple[Shape, ...]:
        return tuple(_slow_friction(part, usual) for part in (0.03, 0.1, 0.3, 1.0))

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        shape = self.shape["static_excess"], self.shape["stribeck_velocity"]
        return Law(_stribeck, (strength, *shape), sticks=True)


def _slow_friction(part: float, usual: Usual) -> Shape:
    """Friction that fades out around a velocity: the law less its Coulomb part."""
    slow = part * usual.velocity

    def force(v: Floats) -> Floats:
        return -np.sign(v) * np.exp(-((v / slow) ** 2))

    title = f"friction that differs below {slow:.3g} {usual.x}/s"
    return Shape(f"stribeck_{part:g}", title, VELOCITY, force, jumps=True)


def _stribeck(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    rise, slow = constants[1], constants[2]
    return constants[0] * (1 + rise * math.exp(-((v / slow) ** 2)))


@register
class RisingFriction(_DryFriction):
    """Dry friction that is smaller at rest than in motion, as of a seal or a film that shears.

    Bound Fc (1 - lack exp(-(v/vs)^2)).
    """

    name = "rising_friction"
    title = "dry friction that rises with velocity"
    over = (VELOCITY, LOAD_VELOCITY)
    dimensions = {"lack_at_rest": "number", "rising_velocity": "velocity"}
    tuned = ("lack_at_rest", "rising_velocity")
    most = {"lack_at_rest": 1.0}
    plain = {"lack_at_rest": 0.0}

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return tuple(
            cls(place, {"lack_at_rest": 0.7, "rising_velocity": share * usual})
            for place, usual in rms_velocities(motion).items()
            for share in (0.2, 0.6)
        )

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        shape = self.shape["lack_at_rest"], self.shape["rising_velocity"]
        return Law(_stribeck, (strength, -shape[0], shape[1]), sticks=True)


@register
class FrictionAlongTheWay(_DryFriction):
    """Dry friction that grows along the way, or falls, as of a guide that is tighter at one end.

    Bound Fc ratio^((x - middle)/span): to first order a straight line, and never below zero.
    """

    name = "friction_along_the_way"
    title = "dry friction that changes along the way"
    over = (VELOCITY,)
    dimensions = {"friction_ratio": "number", "way_middle": "position", "way_span": "position"}
    tuned = ("friction_ratio",)
    plain = {"friction_ratio": 1.0}

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        position = motion[MOTOR].position
        span = 4 * float(position.std())
        way = {"way_middle": float(position.mean()), "way_span": span}
        return tuple(cls(MOTOR, {"friction_ratio": ratio, **way}) for ratio in (0.5, 2.0))

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        shape = self.shape
        fast = math.log(shape["friction_ratio"]) / shape["way_span"]
        return Law(_along_the_way, (strength, fast, shape["way_middle"]), sticks=True)


def _along_the_way(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    return constants[0] * math.exp(constants[1] * (x - constants[2]))


@register
class DahlFriction(_DryFriction):
    """Dry friction that begins as a spring: F' = -s (v + |v| F / Fc) with s = Fc / distance.

    P. R. Dahl, "A solid friction model", Aerospace Corporation, TOR-0158, 1968.
    """

    name = "dahl_friction"
    title = "dry friction that begins as a spring (Dahl)"
    # It may look like a spring, or like nothing but noise.
    over = (VELOCITY, LOAD_VELOCITY, POSITION, STRETCH, EXCESS_NOISE)
    dimensions = {"presliding_distance": "position"}
    tuned = ("presliding_distance",)

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        rate = 2 * np.pi * 10.0  # rad/s; the way of the motion is its velocity over that
        return tuple(
            cls(place, {"presliding_distance": share * usual / rate})
            for place, usual in rms_velocities(motion, _EVERYWHERE).items()
            for share in (0.1, 0.3, 1.0, 3.0)
        )

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(_dahl, (strength, self.shape["presliding_distance"]))


def _dahl(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    """Implicit in the force, so that a stiff beginning is stable."""
    part = step_s / constants[1]
    stiffness = constants[0] * part
    slip = 1 + stiffness * gain + part * abs(v + 0.5 * gain * before)
    return (before - stiffness * v) / slip
