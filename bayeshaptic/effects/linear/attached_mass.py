"""A further mass on a spring: a second vibration mode of the device, or more of the arm."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import BODY, HAND, MOTOR, Typical, apart, grid, place_of, typical
from bayeshaptic.effects.unseen import Unseen, combined
from bayeshaptic.models import LinearSystem, LogNormal, LogUniform, Model, Parameter
from bayeshaptic.recordings.response.etfe import Etfe


def mount(mass: Floats, frequency_hz: Floats, damping_ratio: Floats) -> tuple[Floats, Floats]:
    """Damper and spring of a mass that swings at a frequency when its foot is held."""
    rate = 2 * np.pi * frequency_hz
    return 2 * damping_ratio * mass * rate, mass * rate**2


def modes(sizes: Typical) -> tuple[Floats, Floats]:
    """Frequencies in the band and damping ratios of a mode that nobody has seen; their weights.

    The frequencies are about as far apart as a resonance is wide.
    """
    ratios = (0.015, 0.06)
    frequencies = sizes.frequencies(45)
    return combined(frequencies, ratios)


@dataclass(frozen=True)
class AttachedMass(LinearEffect):
    """A mass hung on one of the model's masses by a spring and a damper.

    Its frequency is that of the mass on its spring with the foot held, sqrt(k/m)/2 pi: where the
    mass it hangs on is held still by it.  Hung on the motor this is the notch of the measured
    response, which a person can read off; the peaks lie beside it, and move with the other masses.

    Attributes
    ----------
    on : str
        Name of the mass that it hangs on: "m1" (also the one of a rigid device), "m2", "mh".
    """

    on: str = MOTOR

    several = True
    belongs_to = "configuration"
    places: ClassVar[tuple[str, ...]]
    prefix: ClassVar[str]
    part: ClassVar[str]

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        sizes = typical(model, etfe)
        return tuple(
            cls(apart(model, cls._parameters(sizes[place], sizes.low_hz, sizes.high_hz)), place)
            for place in cls.places
            if place in sizes
        )

    @classmethod
    def _parameters(cls, carrier: float, low_hz: float, high_hz: float) -> tuple[Parameter, ...]:
        frequency = LogUniform(low_hz, 2 * high_hz)
        mass, damping = LogNormal(0.2 * carrier, 1.5), LogNormal(0.03, 1.0)
        name, part = cls.prefix, cls.part
        return (
            Parameter(f"{name}_hz", "frequency", f"frequency of {part} alone", frequency),
            Parameter(f"{name}_mass", "mass", f"mass of {part}", mass),
            Parameter(f"{name}_damping", "number", f"damping ratio of {part} alone", damping),
        )

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        sizes = typical(model, etfe)
        masses = sizes[self.on] * np.array([0.02, 0.1, 0.3, 1.0])
        return grid(sizes.frequencies(35), masses, [0.03, 0.2])

    def unseen(self, model: Model, etfe: Etfe) -> Unseen:
        """A mode in the band, its mass up to the one that it hangs on."""
        sizes = typical(model, etfe)
        carrier = sizes[self.on]

        def own(share: Floats, shapes: Floats) -> Floats:
            return np.stack([shapes[:, 0], share * carrier, shapes[:, 1]], axis=1)

        title = "its mass over that of what it hangs on"
        return Unseen("number", title, 1.0, own, *modes(sizes), unit_size=carrier)

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        frequency, mass, damping = self.own(values)
        damper, spring = mount(mass, frequency, damping)
        carrier = place_of(self.on, system.mechanism)
        mechanism = system.mechanism.with_mass(mass, carrier, damper, spring)
        return replace(system, mechanism=mechanism)


@register
@dataclass(frozen=True)
class SecondMode(AttachedMass):
    """A vibration mode that the device's model lacks."""

    name = "second_mode"
    title = "second vibration mode"
    ties = ("base_compliance",)
    places = (MOTOR, BODY)
    prefix = "mode"
    part = "the further mass"
    told_apart_by = (
        "strike or shake the suspected part, or add a known mass to it and look which mode moves"
    )


@register
@dataclass(frozen=True)
class ArmMode(AttachedMass):
    """More of the arm than one mass: the forearm behind the hand's mass, or the fingers on it."""

    name = "arm_mode"
    title = "further mass in the hand or arm"
    ties = ("reflex",)
    belongs_to = ""
    told_apart_by = "another posture or a relaxed grip: it changes with it, and a reflex fades"
    places = (HAND,)
    prefix = "arm"
    part = "the further part of the arm"
