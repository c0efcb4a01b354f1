"""What an effect on the bench may change, and the registry of effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, TypeVar

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.dynamics.structure import Structure


@dataclass(frozen=True)
class MotionScales:
    """Sizes that make an effect's default strength sensible on a bench.

    Attributes
    ----------
    force : float
        Root mean square of the usual excitation.
    position, velocity : float
        Root mean square of the motor's motion under it, without effects.
    stretch : float
        The same of the stretch of the connection between m1 and m2; 0 without m2.
    resolution : float
        One count of the encoder.
    period_s : float
    parameters : mapping of str to float
        Of the mechanism.
    """

    force: float
    position: float
    velocity: float
    stretch: float
    resolution: float
    period_s: float
    parameters: Mapping[str, float]


@dataclass(frozen=True)
class Readings:
    """What the encoder is about to read: stamps, positions and velocities, shape (samples,)."""

    time_s: Array
    position: Array
    velocity: Array


@dataclass(frozen=True)
class Log:
    """What is written down: time stamps, commands and positions, shape (samples,)."""

    time_s: Array
    force: Array
    position: Array

    def rows(self, index: Array) -> Log:
        """Some of the rows, by their indices."""
        return Log(self.time_s[index], self.force[index], self.position[index])


@dataclass(frozen=True)
class Effect:
    """Something that happens on the bench beside the plain chain; override what it touches.

    An effect is a frozen dataclass with a `name`. Of the hooks below, `build`, `parameters`,
    `command`, `sense` and `resolution` act inside a closed loop too; `log` acts on what is written
    down.

    Attributes
    ----------
    varies : bool
        Whether `parameters` depends on the progress.
    above_zero, at_least_zero : tuple of str
        Fields that must be so; all numbers must be finite.
    """

    name: ClassVar[str]
    varies: ClassVar[bool] = False
    above_zero: ClassVar[tuple[str, ...]] = ()
    at_least_zero: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, str | bool | tuple):
                continue
            wanted = ""
            if field.name in self.above_zero and value <= 0:
                wanted = "above zero"
            elif field.name in self.at_least_zero and value < 0:
                wanted = "of at least zero"
            elif not math.isfinite(value):
                wanted = "that is finite"
            if wanted:
                raise InputError(
                    f"effect '{self.name}': {field.name} is {value:g}; give a number {wanted}"
                )

    @classmethod
    def typical(cls, scales: MotionScales) -> Effect:
        """The effect at a strength that is clear, but not absurd, on a bench with these scales."""
        return cls()

    def parameters(self, values: Mapping[str, float], progress: float) -> Mapping[str, float]:
        """The mechanism's parameters when a part `progress` (0..1) of the recording is over."""
        return values

    def build(self, structure: Structure) -> None:
        """Add to the structure: masses, links, laws, lags, filters, delay."""

    def command(self, force: Array, progress: Array, time_s: Array) -> Array:
        """What the actuator gets of the commands.

        Parameters
        ----------
        force : ndarray, shape (N,)
            Commands, N or N m.
        progress : ndarray, shape (N,)
            Part of the recording that is over, 0 to 1.
        time_s : ndarray, shape (N,)
        """
        return force

    def sense(self, samples: Readings, rng: np.random.Generator) -> Readings:
        """What the encoder gets to see, before it is rounded to counts; `rng` is its own."""
        return samples

    def resolution(self, resolution: float) -> float:
        """The encoder's count, m or rad, where it is `resolution` without the effect."""
        return resolution

    def log(self, log: Log, rng: np.random.Generator) -> Log:
        """What is written down; `rng` is its own."""
        return log


REGISTRY: dict[str, type[Effect]] = {}
EffectType = TypeVar("EffectType", bound=type[Effect])


def register(effect: EffectType) -> EffectType:
    """Class decorator: make an effect known by its name."""
    REGISTRY[effect.name] = effect
    return effect


def make_effect(name: str, scales: MotionScales, **changes: Any) -> Effect:
    """A registered effect at its typical strength, with `changes` to its fields.

    Raises
    ------
    InputError
        For a name that is not registered, or a field that the effect does not have.
    """
    if name not in REGISTRY:
        raise InputError(f"unknown effect '{name}'; the bench knows {', '.join(sorted(REGISTRY))}")
    effect = REGISTRY[name].typical(scales)
    for key, value in changes.items():
        if type(getattr(effect, key, None)) is int:
            if not float(value).is_integer():
                raise InputError(f"effect '{name}': {key} is {value:g}; give a whole number")
            changes[key] = int(value)
    try:
        return replace(effect, **changes)
    except TypeError:
        known = [field.name for field in fields(effect)]
        unknown = sorted(set(changes) - set(known))
        raise InputError(
            f"effect '{name}' has no {', '.join(unknown)}; it has {', '.join(known) or 'no fields'}"
        ) from None
