"""Springs that are not linear: hardening or softening, and a gap in the connection."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import ClassVar

import numpy as np

from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, MOTOR, Law, Place
from bayeshaptic.effects.nonlinear.protocol import Floats, Motion, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import POSITION, STRETCH, Shape, Usual
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import device_mass
from bayeshaptic.models import Model

_THREE = "\N{SUPERSCRIPT THREE}"


def _square(x: Floats) -> Floats:
    return -x * np.abs(x)


def _cube(x: Floats) -> Floats:
    return -(x**3)


@register
class HardeningSpring(NonlinearEffect):
    """A force -k3 x^3, to the ground or in the connection; softening where k3 is negative."""

    name = "hardening_spring"
    title = "hardening (or softening) spring"
    tests = (
        Shape("x^3", f"a force like x{_THREE}, as a hardening spring", POSITION, _cube),
        Shape("x^2", "a force like x\N{SUPERSCRIPT TWO}", POSITION, lambda x: -(x**2)),
        Shape("stretch^3", "a cubic force in the connection", STRETCH, _cube),
    )
    over = (POSITION, STRETCH)
    strength = ("cubic_stiffness", "cubic_stiffness")
    signed = True

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        return tuple(cls(place) for place in (MOTOR, CONNECTION) if place in motion)

    def called_for(self, raised: set[str]) -> bool:
        return (STRETCH if self.place == CONNECTION else POSITION) in raised

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        title = "spring {where} that hardens or softens with the"
        return (
            Shape("spring_cube", f"{title} cube", POSITION, _cube, "cubic_stiffness"),
            Shape("spring_square", f"{title} square", POSITION, _square, "{force}/{x}^2"),
        )

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        if self.place == CONNECTION:
            stiffness = theta[model.names.index("kc")]
        else:
            stiffness = device_mass(model, theta) * (2 * np.pi * 2.0) ** 2
        scale = stiffness / np.mean(motion.position**2)
        return scale * np.array([0.001, 0.003, 0.01, 0.03, 0.1])

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(_cubic, (strength,))


def _cubic(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    return -constants[0] * x * x * x


@register
class Backlash(NonlinearEffect):
    """A gap in the connection: within it the spring of the transmission does nothing.

    The strength is half the gap; the force gives back what the linear connection takes inside it:
    the spring, and a part of the damper.
    """

    name = "backlash"
    title = "backlash in the connection"
    tests = (
        Shape(
            "clipped stretch", "a gap in the connection", STRETCH, lambda x: np.clip(x, -0.5, 0.5)
        ),
    )
    over = (STRETCH,)
    strength = ("half_gap", "position")
    dimensions = {"damping_in_gap": "number"}
    tuned = ("damping_in_gap",)
    most: ClassVar[Mapping[str, float]] = {"damping_in_gap": 1.0}

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        if CONNECTION not in motion:
            return ()
        return (cls(CONNECTION, {"damping_in_gap": 0.9}),)

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        if place != CONNECTION:
            return ()
        return tuple(_gap_of(part * usual.position, usual.x) for part in (0.1, 0.3, 1.0))

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return float(motion.position.std()) * np.array([0.05, 0.1, 0.2, 0.3])

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        values = dict(zip(model.names, theta, strict=True))
        damping = (1 - self.shape["damping_in_gap"]) * values["bc"]
        return Law(_gap, (strength, values["kc"], damping), observed=True)


def _gap_of(half: float, unit: str) -> Shape:
    title = f"gap of +-{half:.3g} {unit} {{where}}"
    force = partial(np.clip, a_min=-half, a_max=half)
    return Shape("gap", title, POSITION, force, "stiffness", positive=True)


def _gap(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    """What the linear connection takes inside the gap, given back."""
    half, stiffness, damping = constants[0], constants[1], constants[2]
    # Without a branch: which side a step is on is not to be foreseen.
    inside = stiffness * x + damping * v
    return inside if abs(x) <= half else math.copysign(stiffness * half, x)
