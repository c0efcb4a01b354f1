"""Nonlinear springs, play, cogging, drag."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

from bayeshaptic.rig.dynamics.laws import Drag as DragLaw, Gap, PowerSpring, Ripple
from bayeshaptic.rig.dynamics.structure import FRAME, NodeLaw, Structure
from bayeshaptic.rig.effects.effect import Effect, MotionScales, register

# Root mean square of x^3 over the cube of that of x, for a Gaussian x.
CUBE = 15.0**0.5


@register
@dataclass(frozen=True)
class HardeningSpring(Effect):
    """A cubic spring from a mass to the frame, -stiffness x^3; negative softens.

    Attributes
    ----------
    stiffness : float
        N/m^3 or N m/rad^3.
    on : str
        The mass that it acts on, by its name.
    """

    name: ClassVar[str] = "hardening_spring"
    stiffness: float = 5e6
    on: str = "m1"

    @classmethod
    def typical(cls, scales: MotionScales) -> HardeningSpring:
        return cls(0.2 * scales.force / (CUBE * scales.position**3))

    def build(self, structure: Structure) -> None:
        structure.check(self.on)
        structure.laws.append(NodeLaw(self.on, FRAME, PowerSpring(self.stiffness)))


@register
@dataclass(frozen=True)
class HardeningConnection(Effect):
    """A cubic spring beside the connection m1-m2, -stiffness d^3; negative softens.

    Attributes
    ----------
    stiffness : float
        N/m^3 or N m/rad^3.
    """

    name: ClassVar[str] = "hardening_connection"
    stiffness: float = 1e12

    @classmethod
    def typical(cls, scales: MotionScales) -> HardeningConnection:
        return cls(0.2 * scales.force / (CUBE * scales.stretch**3)) if scales.stretch else cls()

    def build(self, structure: Structure) -> None:
        structure.link("m1", "m2")
        structure.laws.append(NodeLaw("m1", "m2", PowerSpring(self.stiffness)))


@register
@dataclass(frozen=True)
class Backlash(Effect):
    """Play in the connection m1-m2: its spring begins `gap` to either side of the middle.

    Attributes
    ----------
    gap : float
        Half the play, m or rad.
    free_damping : float
        Part of the connection's damping that is absent inside the play, 0 to 1.
    """

    name: ClassVar[str] = "backlash"
    at_least_zero: ClassVar[tuple[str, ...]] = ("gap", "free_damping")
    gap: float = 3e-5
    free_damping: float = 0.0

    @classmethod
    def typical(cls, scales: MotionScales) -> Backlash:
        return cls(0.4 * scales.stretch) if scales.stretch else cls()

    def build(self, structure: Structure) -> None:
        link = structure.link("m1", "m2")
        law = Gap(link.stiffness, self.gap, self.free_damping * link.damping)
        structure.laws.append(NodeLaw("m1", "m2", law))


@register
@dataclass(frozen=True)
class ForceRipple(Effect):
    """A force on the motor that repeats with the position: amplitude sin(2 pi x/pitch + phase).

    Attributes
    ----------
    amplitude : float
        N or N m.
    pitch : float
        m or rad.
    phase : float
        Radians.
    """

    name: ClassVar[str] = "force_ripple"
    above_zero: ClassVar[tuple[str, ...]] = ("pitch",)
    amplitude: float = 0.4
    pitch: float = 0.01
    phase: float = 0.0

    @classmethod
    def typical(cls, scales: MotionScales) -> ForceRipple:
        return cls(0.05 * scales.force, scales.position)

    def build(self, structure: Structure) -> None:
        law = Ripple(self.amplitude, self.pitch, self.phase)
        structure.laws.append(NodeLaw(structure.motor, FRAME, law))


@register
@dataclass(frozen=True)
class Gravity(Effect):
    """A weight on a turning part: -torque sin(x - hangs_at) on the motor, x in radians.

    Attributes
    ----------
    torque : float
        N m.
    hangs_at : float
        Radians, where the weight hangs straight down.
    """

    name: ClassVar[str] = "gravity"
    at_least_zero: ClassVar[tuple[str, ...]] = ("torque",)
    torque: float = 0.05
    hangs_at: float = 0.0

    @classmethod
    def typical(cls, scales: MotionScales) -> Gravity:
        return cls(0.5 * scales.force)

    def build(self, structure: Structure) -> None:
        law = Ripple(-self.torque, 2 * math.pi, -self.hangs_at)
        structure.laws.append(NodeLaw(structure.motor, FRAME, law))


@register
@dataclass(frozen=True)
class ConstantForce(Effect):
    """A force on the motor that never changes: a spring far away, a weight on a straight axis.

    Attributes
    ----------
    force : float
        N or N m.
    """

    name: ClassVar[str] = "constant_force"
    force: float = 0.2

    @classmethod
    def typical(cls, scales: MotionScales) -> ConstantForce:
        return cls(0.03 * scales.force)

    def build(self, structure: Structure) -> None:
        # A wave so long that it stays where it begins.
        law = Ripple(self.force, 1e9, 0.5 * math.pi)
        structure.laws.append(NodeLaw(structure.motor, FRAME, law))


@register
@dataclass(frozen=True)
class Drag(Effect):
    """A resistance -coefficient v |v| on a mass.

    Attributes
    ----------
    coefficient : float
        N s^2/m^2 or N m s^2/rad^2.
    on : str
        The mass that it acts on, by its name.
    """

    name: ClassVar[str] = "drag"
    at_least_zero: ClassVar[tuple[str, ...]] = ("coefficient",)
    coefficient: float = 500.0
    on: str = "m1"

    @classmethod
    def typical(cls, scales: MotionScales) -> Drag:
        return cls(0.2 * scales.force / (3.0**0.5 * scales.velocity**2))

    def build(self, structure: Structure) -> None:
        structure.check(self.on)
        structure.laws.append(NodeLaw(self.on, FRAME, DragLaw(self.coefficient)))
