"""Effects of the person who holds the device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.structure import GROUND, DelayedSpring, Structure
from bayeshaptic.rig.effects.effect import Effect, MotionScales, register


@register
@dataclass(frozen=True)
class Reflex(Effect):
    """The hand answers its own motion late, through a nerve and a muscle.

    The force -(stiffness + damping s) e^(-s delay_s)/(1 + s time_constant_s) x on the hand's mass.

    Attributes
    ----------
    stiffness, damping : float
        N/m and N s/m, or N m/rad and N m s/rad.
    delay_s, time_constant_s : float
        Of the nerve, and of the muscle.
    """

    name: ClassVar[str] = "reflex"
    above_zero: ClassVar[tuple[str, ...]] = ("delay_s",)
    at_least_zero: ClassVar[tuple[str, ...]] = ("time_constant_s",)
    stiffness: float = 60.0
    damping: float = 8.0
    delay_s: float = 0.03
    time_constant_s: float = 0.01

    @classmethod
    def typical(cls, scales: MotionScales) -> Reflex:
        values = scales.parameters
        return cls(0.5 * values.get("kh", 0.0), 0.5 * values.get("bh", 0.0))

    def build(self, structure: Structure) -> None:
        if structure.hand is None:
            raise InputError("a reflex needs a hand; use a grasped bench")
        structure.delayed.append(
            DelayedSpring(
                structure.hand,
                GROUND,
                self.stiffness,
                self.damping,
                self.delay_s,
                self.time_constant_s,
            )
        )


@register
@dataclass(frozen=True)
class GripDrift(Effect):
    """The grip changes: some of the hand's parameters end up `ratio` times larger.

    Attributes
    ----------
    ratio : float
    which : tuple of str
        Parameters of the grasped mechanism that change.
    shape : {"ramp", "step"}
        Geometrically from beginning to end, or all at once.
    at : float
        When the step happens, as a part of the recording.
    """

    name: ClassVar[str] = "grip_drift"
    above_zero: ClassVar[tuple[str, ...]] = ("ratio",)
    varies: ClassVar[bool] = True
    ratio: float = 1.8
    which: tuple[str, ...] = ("kh", "bh", "ks", "bs")
    shape: str = "ramp"
    at: float = 0.5

    def parameters(self, values: Mapping[str, float], progress: float) -> Mapping[str, float]:
        unknown = [name for name in self.which if name not in values]
        if unknown:
            raise InputError(
                f"grip_drift changes {', '.join(unknown)}, which this bench does not have; "
                "use a grasped bench, or name other parameters"
            )
        if self.shape not in ("ramp", "step"):
            raise InputError(f"grip_drift has shape ramp or step, not '{self.shape}'")
        done = progress if self.shape == "ramp" else float(progress >= self.at)
        return {**values, **{name: values[name] * self.ratio**done for name in self.which}}
