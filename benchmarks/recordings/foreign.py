"""Effects for the bench that neither it nor the library has: what nobody thought of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from bayeshaptic.rig.dynamics.laws import DryFriction, SmoothLaw
from bayeshaptic.rig.dynamics.structure import FRAME, NodeLaw, Structure
from bayeshaptic.rig.effects.effect import Effect, MotionScales, Readings
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class TanhSaturation(Effect):
    """An actuator that gives limit tanh(u / limit)."""

    name: ClassVar[str] = "tanh_saturation"
    limit: float = 8.0

    @classmethod
    def typical(cls, scales: MotionScales) -> TanhSaturation:
        return cls(2.0 * scales.force)

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        return np.asarray(self.limit * np.tanh(force / self.limit))


@dataclass(frozen=True)
class AsymmetricGain(Effect):
    """An actuator that pushes in full and pulls by a share less."""

    name: ClassVar[str] = "asymmetric_gain"
    share: float = 0.25

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        return np.asarray(force - self.share * np.minimum(force, 0.0))


@dataclass(frozen=True)
class CoarseCommand(Effect):
    """An actuator that knows only multiples of a step."""

    name: ClassVar[str] = "coarse_command"
    step: float = 2.0

    @classmethod
    def typical(cls, scales: MotionScales) -> CoarseCommand:
        return cls(0.5 * scales.force)

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        return np.asarray(np.round(force / self.step) * self.step)


@dataclass(frozen=True)
class EccentricEncoder(Effect):
    """An encoder disc off its centre: a reading that waves along the position."""

    name: ClassVar[str] = "eccentric_encoder"
    amplitude: float = 1e-4
    pitch: float = 1e-2

    @classmethod
    def typical(cls, scales: MotionScales) -> EccentricEncoder:
        return cls(0.03 * scales.position, 0.7 * scales.position)

    def sense(self, samples: Readings, rng: np.random.Generator) -> Readings:
        wave = self.amplitude * np.sin(2 * np.pi * samples.position / self.pitch)
        return replace(samples, position=samples.position + wave)


@dataclass(frozen=True)
class _Cube(SmoothLaw):
    coefficient: float

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return -constants[0] * v**3


@dataclass(frozen=True)
class _Lopsided(SmoothLaw):
    level: float
    velocity: float

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return -constants[0] * math.tanh(v / constants[1]) * (1.4 if v > 0 else 0.6)


@dataclass(frozen=True)
class _Stops(SmoothLaw):
    stiffness: float
    free: float

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return -constants[0] * (max(q - constants[1], 0.0) + min(q + constants[1], 0.0))


@dataclass(frozen=True)
class VelocityCubed(Effect):
    """A damper whose force grows with the cube of the velocity."""

    name: ClassVar[str] = "velocity_cubed"
    coefficient: float = 100.0

    @classmethod
    def typical(cls, scales: MotionScales) -> VelocityCubed:
        return cls(0.2 * scales.force / (15**0.5 * scales.velocity**3))

    def build(self, structure: Structure) -> None:
        structure.laws.append(NodeLaw("m1", FRAME, _Cube(self.coefficient)))


@dataclass(frozen=True)
class _Tighter(SmoothLaw):
    growth: float

    @staticmethod
    def force(q: float, v: float, before: float, dq: float, constants: Sequence[float]) -> float:
        return -constants[0] * q**2 * v


@dataclass(frozen=True)
class TighterAway(Effect):
    """A damper that grows with the square of the way from where the device began."""

    name: ClassVar[str] = "tighter_away"
    growth: float = 1000.0

    @classmethod
    def typical(cls, scales: MotionScales) -> TighterAway:
        damping = sum(scales.parameters.get(name, 0.0) for name in ("b1", "b2"))
        return cls(0.5 * damping / scales.position**2)

    def build(self, structure: Structure) -> None:
        structure.laws.append(NodeLaw("m1", FRAME, _Tighter(self.growth)))


@dataclass(frozen=True)
class LoadFriction(Effect):
    """Dry friction on the far mass."""

    name: ClassVar[str] = "load_friction"
    between: ClassVar[tuple[str, str]] = ("m2", FRAME)
    force: float = 0.6

    @classmethod
    def typical(cls, scales: MotionScales) -> LoadFriction:
        return cls(0.15 * scales.force)

    def build(self, structure: Structure) -> None:
        structure.laws.append(NodeLaw(*self.between, DryFriction(self.force, self.force)))


@dataclass(frozen=True)
class Hysteresis(LoadFriction):
    """Dry friction of the transmission against its own stretching, as of a cable or a gear."""

    name: ClassVar[str] = "hysteresis"
    between: ClassVar[tuple[str, str]] = ("m1", "m2")


@dataclass(frozen=True)
class LopsidedFriction(Effect):
    """Friction that is larger one way, and that does not stick."""

    name: ClassVar[str] = "lopsided_friction"
    force: float = 0.5
    velocity: float = 3e-3

    @classmethod
    def typical(cls, scales: MotionScales) -> LopsidedFriction:
        return cls(0.12 * scales.force, 0.03 * scales.velocity)

    def build(self, structure: Structure) -> None:
        structure.laws.append(NodeLaw("m1", FRAME, _Lopsided(self.force, self.velocity)))


@dataclass(frozen=True)
class EndStops(Effect):
    """Soft stops that the motion runs into now and then."""

    name: ClassVar[str] = "end_stops"
    stiffness: float = 1e4
    free: float = 1e-2

    @classmethod
    def typical(cls, scales: MotionScales) -> EndStops:
        return cls(5 * scales.force / scales.position, 1.3 * scales.position)

    def build(self, structure: Structure) -> None:
        structure.laws.append(NodeLaw("m1", FRAME, _Stops(self.stiffness, self.free)))


EFFECTS: dict[str, type[Effect]] = {
    effect.name: effect
    for effect in (
        TanhSaturation,
        AsymmetricGain,
        CoarseCommand,
        EccentricEncoder,
        VelocityCubed,
        TighterAway,
        LoadFriction,
        LopsidedFriction,
        EndStops,
    )
}
