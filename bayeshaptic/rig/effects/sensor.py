"""Effects of the encoder, the clock and the logger."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.effects.effect import Effect, Log, MotionScales, Readings, register


@register
@dataclass(frozen=True)
class Quantisation(Effect):
    """A coarser encoder than declared: counts of `count`.

    Attributes
    ----------
    count : float
        m or rad.
    """

    name: ClassVar[str] = "quantisation"
    above_zero: ClassVar[tuple[str, ...]] = ("count",)
    count: float = 3.14e-5

    @classmethod
    def typical(cls, scales: MotionScales) -> Quantisation:
        return cls(6 * scales.resolution) if scales.resolution else cls(0.01 * scales.position)

    def resolution(self, resolution: float) -> float:
        return self.count


@register
@dataclass(frozen=True)
class MainsTone(Effect):
    """Mains hum on the position that is read, or on the force that acts.

    Attributes
    ----------
    amplitude : float
        m or rad; N or N m on the force.
    frequency_hz : float
    phase : float
        Radians.
    on : {"position", "force"}
    """

    name: ClassVar[str] = "mains_tone"
    above_zero: ClassVar[tuple[str, ...]] = ("frequency_hz",)
    amplitude: float = 3e-5
    frequency_hz: float = 50.0
    phase: float = 1.0
    on: str = "position"

    @classmethod
    def typical(cls, scales: MotionScales) -> MainsTone:
        return cls(0.03 * scales.position)

    def _tone(self, time_s: Array) -> Array:
        if self.on not in ("position", "force"):
            raise InputError(f"mains_tone is on position or force, not '{self.on}'")
        return self.amplitude * np.sin(2 * np.pi * self.frequency_hz * time_s + self.phase)

    def command(self, force: Array, progress: Array, time_s: Array) -> Array:
        return force + self._tone(time_s) if self.on == "force" else force

    def sense(self, samples: Readings, rng: np.random.Generator) -> Readings:
        if self.on == "force":
            return samples
        return replace(samples, position=samples.position + self._tone(samples.time_s))


@register
@dataclass(frozen=True)
class PositionClipping(Effect):
    """The position cannot be read beyond +-`limit`.

    Attributes
    ----------
    limit : float
        m or rad.
    """

    name: ClassVar[str] = "position_clipping"
    above_zero: ClassVar[tuple[str, ...]] = ("limit",)
    limit: float = 0.05

    @classmethod
    def typical(cls, scales: MotionScales) -> PositionClipping:
        return cls(1.5 * scales.position)

    def sense(self, samples: Readings, rng: np.random.Generator) -> Readings:
        return replace(samples, position=np.clip(samples.position, -self.limit, self.limit))


@register
@dataclass(frozen=True)
class SampleJitter(Effect):
    """Positions are read a little early or late, with a standard deviation of `sd_s`.

    Attributes
    ----------
    sd_s : float
    stamped : bool
        Whether the time stamps show it.
    """

    name: ClassVar[str] = "sample_jitter"
    at_least_zero: ClassVar[tuple[str, ...]] = ("sd_s",)
    sd_s: float = 5e-5
    stamped: bool = False

    @classmethod
    def typical(cls, scales: MotionScales) -> SampleJitter:
        return cls(0.05 * scales.period_s)

    def sense(self, samples: Readings, rng: np.random.Generator) -> Readings:
        late = rng.normal(0.0, self.sd_s, len(samples.time_s))
        stamps = samples.time_s + late if self.stamped else samples.time_s
        return replace(samples, position=samples.position + late * samples.velocity, time_s=stamps)


@register
@dataclass(frozen=True)
class HeldSamples(Effect):
    """Now and then the logger repeats the position before, up to `longest` times in a row.

    Attributes
    ----------
    probability : float
        That a sample begins such a stretch.
    longest : int
        Samples.
    """

    name: ClassVar[str] = "held_samples"
    above_zero: ClassVar[tuple[str, ...]] = ("longest",)
    at_least_zero: ClassVar[tuple[str, ...]] = ("probability",)
    probability: float = 0.01
    longest: int = 3

    def log(self, log: Log, rng: np.random.Generator) -> Log:
        count = len(log.position)
        source = np.arange(count)
        starts = np.flatnonzero(rng.random(count) < self.probability)
        lengths = rng.integers(1, self.longest + 1, len(starts))
        for start, length in zip(starts.tolist(), lengths.tolist(), strict=True):
            source[start : start + length] = source[max(start - 1, 0)]
        return replace(log, position=log.position[source])


@register
@dataclass(frozen=True)
class DroppedSamples(Effect):
    """Now and then a row is missing: the time stamps jump.

    Attributes
    ----------
    probability : float
        Of each row.
    """

    name: ClassVar[str] = "dropped_samples"
    at_least_zero: ClassVar[tuple[str, ...]] = ("probability",)
    probability: float = 1e-3

    def log(self, log: Log, rng: np.random.Generator) -> Log:
        kept = rng.random(len(log.time_s)) >= self.probability
        return log.rows(np.flatnonzero(kept))
