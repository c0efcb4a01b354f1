"""What a force may be made of: the terms of the inverse dynamics, over a smoothed motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.diagnosis.feedback.smooth_motion import SmoothMotion
from bayeshaptic.effects.laws import corrections, fitted
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.shapes import VELOCITY, Shape, Usual
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Term:
    """One column of the inverse dynamics: what it is, and the unit of its coefficient."""

    name: str
    title: str
    unit: str


@dataclass(frozen=True)
class Column(Term):
    """A term with the function that makes its column.

    Attributes
    ----------
    column : callable
        From `SmoothMotion` to the force for a coefficient of one, (N,).
    linear : bool
        Whether it is as smooth as the motion.
    positive : bool
        Whether a coefficient below zero makes no sense.
    """

    column: Callable[[SmoothMotion], Floats] = field(repr=False)
    linear: bool = False
    positive: bool = False


def terms_of(
    recording: Recording, path: SmoothMotion
) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
    """Those of the linear model, and those that may join it."""
    middle = float(np.mean(path.position))

    def unit(dimension: str) -> str:
        return unit_of(dimension, recording.force_unit, recording.position_unit)

    force, x = unit("force"), recording.position_unit
    start = (
        Column("mass", "mass", unit("mass"), lambda p: p.acceleration, linear=True),
        Column("damping", "viscous damping", unit("damping"), lambda p: p.velocity, linear=True),
        Column("offset", "constant force", force, lambda p: np.ones_like(p.velocity), linear=True),
    )
    usual = Usual.of(path.velocity, path.position, x)
    laws = [*(shape for _, shape in fitted(MOTOR, usual)), *corrections(usual)]
    return start, (
        *(_term(shape, force, x, middle) for shape in laws),
        Column(
            "asymmetric_damping",
            "damping that differs between the directions",
            unit("damping"),
            lambda p: np.abs(p.velocity),
        ),
        Column(
            "friction_root",
            "friction that grows with the root of the velocity",
            f"{force} ({x}/s)^-1/2",
            lambda p: np.sign(p.velocity) * np.sqrt(np.abs(p.velocity)),
        ),
        Column("spring", "spring", unit("stiffness"), lambda p: p.position - middle, linear=True),
        Column(
            "friction_slope",
            "friction that changes along the way",
            unit("stiffness"),
            lambda p: (p.position - middle) * np.sign(p.velocity),
        ),
        Column(
            "jerk",
            "lag between force and motion",
            f"{force} s^3/{x}",
            lambda p: p.jerk,
            linear=True,
        ),
    )


def _term(shape: Shape, force: str, x: str, middle: float) -> Column:
    """A law's force, as the command must make up for it."""

    def column(path: SmoothMotion) -> Floats:
        return -shape.force(path.velocity if shape.over == VELOCITY else path.position - middle)

    title = shape.title.replace(" {where}", "")
    return Column(shape.name, title, shape.unit(force, x), column, positive=shape.positive)
