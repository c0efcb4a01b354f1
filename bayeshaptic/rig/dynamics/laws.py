"""Nonlinear forces between two nodes as laws of their relative position q and velocity v."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar


class Law:
    """A nonlinear force on a coordinate q with velocity v.

    Attributes
    ----------
    dry : bool
        True for friction that sticks: the time stepper then asks for `bound` instead of `force`.
    """

    dry: ClassVar[bool] = False


@dataclass(frozen=True)
class SmoothLaw(Law):
    """A force that is a continuous function of the motion."""

    def force(self, q: float, v: float, before: float, dq: float) -> float:
        """The force at the end of a step.

        Parameters
        ----------
        q, v : float
            Relative position and velocity at the end of the step.
        before : float
            The force at its beginning.
        dq : float
            How far q moved in it.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class PowerSpring(SmoothLaw):
    """-coefficient q^power, an odd power: a cubic spring hardens, or softens if negative."""

    coefficient: float
    power: int = 3

    def force(self, q: float, v: float, before: float, dq: float) -> float:
        return -self.coefficient * q**self.power


@dataclass(frozen=True)
class Gap(SmoothLaw):
    """What a gap of +-`gap` takes away from a linear spring and damper.

    Added to the link -(stiffness q + damping v), the sum is a spring that begins at the edges of
    the gap. `free_damping` is the part of the damping that is absent inside it.
    """

    stiffness: float
    gap: float
    free_damping: float = 0.0

    def force(self, q: float, v: float, before: float, dq: float) -> float:
        inside = min(max(q, -self.gap), self.gap)
        lost = self.free_damping * v if inside == q else 0.0
        return self.stiffness * inside + lost


@dataclass(frozen=True)
class Ripple(SmoothLaw):
    """A force that repeats with the position (cogging): amplitude sin(2 pi q/pitch + phase)."""

    amplitude: float
    pitch: float
    phase: float = 0.0

    def force(self, q: float, v: float, before: float, dq: float) -> float:
        return self.amplitude * math.sin(2 * math.pi * q / self.pitch + self.phase)


@dataclass(frozen=True)
class Drag(SmoothLaw):
    """-coefficient v |v|, the resistance of a turbulent fluid."""

    coefficient: float

    def force(self, q: float, v: float, before: float, dq: float) -> float:
        return -self.coefficient * v * abs(v)


@dataclass(frozen=True)
class Dahl(SmoothLaw):
    """Dahl's friction F' = -sigma (v + |v| F/level), exact for a step in one direction.

    P. R. Dahl, "A solid friction model", Aerospace Corporation TOR-0158 (1968).
    """

    level: float
    sigma: float

    def force(self, q: float, v: float, before: float, dq: float) -> float:
        end = -math.copysign(self.level, dq)
        return end + (before - end) * math.exp(-self.sigma * abs(dq) / self.level)


@dataclass(frozen=True)
class DryFriction(Law):
    """Friction that sticks: Coulomb's, with Stribeck's dip where `static` exceeds `level`.

    Sliding, the force is -sign(v) (level + (static - level) exp(-(v/stribeck_velocity)^2)); at
    rest it is whatever keeps the rest, up to `static`.
    """

    level: float
    static: float
    stribeck_velocity: float = math.inf
    dry: ClassVar[bool] = True

    @property
    def constant(self) -> bool:
        """Whether the sliding force is the same at every velocity."""
        return self.static == self.level

    def bound(self, v: float) -> float:
        """Size of the sliding force at the velocity v."""
        if self.static == self.level:
            return self.level
        dip = math.exp(-((v / self.stribeck_velocity) ** 2))
        return self.level + (self.static - self.level) * dip
