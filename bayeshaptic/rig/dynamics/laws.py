"""Nonlinear forces between two nodes as laws of their relative position q and velocity v."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from typing import ClassVar


class Law:
    """A nonlinear force on a coordinate q with velocity v.

    Attributes
    ----------
    dry : bool
        True for friction that sticks: the time stepper finds its force.
    """

    dry: ClassVar[bool] = False

    @property
    def constants(self) -> tuple[float, ...]:
        """The fields, in their order."""
        return astuple(self)  # type: ignore[call-overload]


@dataclass(frozen=True)
class SmoothLaw(Law):
    """A force that is a continuous function of the motion."""

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        """The force at the end of a step; compiled, so that it takes numbers and no object.

        Parameters
        ----------
        q, v : float
            Relative position and velocity at the end of the step.
        before : float
            The force at its beginning.
        dq : float
            How far q moved in it.
        constants : sequence of float
            As `constants`.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class PowerSpring(SmoothLaw):
    """-coefficient q^power, an odd power: a cubic spring hardens, or softens if negative.

    Attributes
    ----------
    coefficient : float
        Force over position to that power.
    power : int
    """

    coefficient: float
    power: int = 3

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return -constants[0] * q ** int(constants[1])


@dataclass(frozen=True)
class Gap(SmoothLaw):
    """What a gap of +-`gap` takes away from a linear spring and damper.

    Added to the link -(stiffness q + damping v), the sum is a spring that begins at the edges of
    the gap.

    Attributes
    ----------
    stiffness : float
        Of the link, force over position.
    gap : float
        Half of its width, a position.
    free_damping : float
        The part of the link's damping that is absent inside the gap, force over velocity.
    """

    stiffness: float
    gap: float
    free_damping: float = 0.0

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        inside = min(max(q, -constants[1]), constants[1])
        lost = constants[2] * v if inside == q else 0.0
        return constants[0] * inside + lost


@dataclass(frozen=True)
class Ripple(SmoothLaw):
    """A force that repeats with the position (cogging): amplitude sin(2 pi q/pitch + phase).

    Attributes
    ----------
    amplitude : float
        A force.
    pitch : float
        The position after which it repeats.
    phase : float
        Radians.
    """

    amplitude: float
    pitch: float
    phase: float = 0.0

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return constants[0] * math.sin(2 * math.pi * q / constants[1] + constants[2])


@dataclass(frozen=True)
class Drag(SmoothLaw):
    """-coefficient v |v|, the resistance of a turbulent fluid; force over velocity squared."""

    coefficient: float

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return -constants[0] * v * abs(v)


@dataclass(frozen=True)
class Dahl(SmoothLaw):
    """Dahl's friction F' = -sigma (v + |v| F/level), exact for a step in one direction.

    Attributes
    ----------
    level : float
        The force that it ends in.
    sigma : float
        The stiffness that it begins with, force over position.

    References
    ----------
    P. R. Dahl, "A solid friction model", Aerospace Corporation TOR-0158 (1968).
    """

    level: float
    sigma: float

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        end = -math.copysign(constants[0], dq)
        return end + (before - end) * math.exp(-constants[1] * abs(dq) / constants[0])


@dataclass(frozen=True)
class DryFriction(Law):
    """Friction that sticks: Coulomb's, with Stribeck's dip where `static` exceeds `level`.

    Sliding, the force is -sign(v) (level + (static - level) exp(-(v/stribeck_velocity)^2)); at
    rest it is whatever keeps the rest, up to `static`.

    Attributes
    ----------
    level, static : float
        Forces, in fast motion and at rest.
    stribeck_velocity : float
        How fast the one goes over into the other.
    """

    level: float
    static: float
    stribeck_velocity: float = math.inf
    dry: ClassVar[bool] = True

    def bound(self, v: float) -> float:
        """Size of the sliding force at the velocity v, zero or more."""
        return sliding(v, self.constants)


def sliding(v: float, constants: Sequence[float]) -> float:
    """Size of the sliding force of `DryFriction` at the velocity v."""
    level, static, slow = constants
    if static == level:
        return level
    return level + (static - level) * math.exp(-((v / slow) ** 2))
