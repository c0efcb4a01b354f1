"""Dry friction between a mass and the frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayeshaptic.rig.dynamics.laws import Dahl, DryFriction
from bayeshaptic.rig.dynamics.structure import FRAME, NodeLaw, Structure
from bayeshaptic.rig.effects.effect import Effect, MotionScales, register

SHARE = 0.15  # of the rms force: the friction of a usual case


@register
@dataclass(frozen=True)
class CoulombFriction(Effect):
    """A constant force against the motion; at rest whatever holds, up to `force`.

    Attributes
    ----------
    force : float
        N or N m.
    on : str
        The mass that it acts on, by its name.
    """

    name: ClassVar[str] = "coulomb_friction"
    at_least_zero: ClassVar[tuple[str, ...]] = ("force",)
    force: float = 0.6
    on: str = "m1"

    @classmethod
    def typical(cls, scales: MotionScales) -> CoulombFriction:
        return cls(SHARE * scales.force)

    def build(self, structure: Structure) -> None:
        structure.check(self.on)
        law = DryFriction(self.force, self.force)
        structure.laws.append(NodeLaw(self.on, FRAME, law))


@register
@dataclass(frozen=True)
class StribeckFriction(Effect):
    """Dry friction that falls from `static` to `force` as the velocity passes `velocity`.

    force + (static - force) exp(-(v/velocity)^2); R. Stribeck, "Die wesentlichen Eigenschaften der
    Gleit- und Rollenlager", VDI-Zeitschrift 46 (1902).

    Attributes
    ----------
    force, static : float
        N or N m, in fast motion and at rest.
    velocity : float
        m/s or rad/s.
    on : str
        The mass that it acts on, by its name.
    """

    name: ClassVar[str] = "stribeck_friction"
    above_zero: ClassVar[tuple[str, ...]] = ("velocity",)
    at_least_zero: ClassVar[tuple[str, ...]] = ("force", "static")
    force: float = 0.6
    static: float = 1.0
    velocity: float = 0.005
    on: str = "m1"

    @classmethod
    def typical(cls, scales: MotionScales) -> StribeckFriction:
        level = SHARE * scales.force
        return cls(level, 1.6 * level, 0.3 * scales.velocity)

    def build(self, structure: Structure) -> None:
        structure.check(self.on)
        law = DryFriction(self.force, self.static, self.velocity)
        structure.laws.append(NodeLaw(self.on, FRAME, law))


@register
@dataclass(frozen=True)
class DahlFriction(Effect):
    """Friction that begins as a spring: F' = -stiffness (v + |v| F/force).

    Attributes
    ----------
    force : float
        N or N m, that it ends in.
    stiffness : float
        N/m or N m/rad, that it begins with.
    on : str
        The mass that it acts on, by its name.
    """

    name: ClassVar[str] = "dahl_friction"
    above_zero: ClassVar[tuple[str, ...]] = ("force", "stiffness")
    force: float = 0.6
    stiffness: float = 3e3
    on: str = "m1"

    @classmethod
    def typical(cls, scales: MotionScales) -> DahlFriction:
        level = SHARE * scales.force
        return cls(level, level / (0.01 * scales.velocity))

    def build(self, structure: Structure) -> None:
        structure.check(self.on)
        structure.laws.append(NodeLaw(self.on, FRAME, Dahl(self.force, self.stiffness)))
