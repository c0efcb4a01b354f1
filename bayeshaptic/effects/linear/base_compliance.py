"""The device stands on something that gives: a table, a frame, a tripod."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.linear.attached_mass import modes, mount
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import apart, grid, typical
from bayeshaptic.effects.unseen import Unseen
from bayeshaptic.models import LinearSystem, LogNormal, LogUniform, Model, Parameter
from bayeshaptic.recordings.response.etfe import Etfe


@register
@dataclass(frozen=True)
class BaseCompliance(LinearEffect):
    """The motor pushes against a base on a spring, and the encoder reads relative to it.

    Guides and dampers of the device move with the base; the hand leans on the ground.  The
    frequency is that of the base alone on its feet.
    """

    name = "base_compliance"
    title = "compliant base"
    ties = ("second_mode",)
    told_apart_by = "clamp the base, or load it with a known mass; or an accelerometer on it"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        if any(isinstance(effect, cls) for effect in model.effects):  # a device has one base
            return ()
        sizes = typical(model, etfe)
        frequency = LogUniform(sizes.low_hz, 2 * sizes.high_hz)
        mass, damping = LogNormal(5 * sizes.device_mass, 1.5), LogNormal(0.03, 1.0)
        parameters = (
            Parameter("base_hz", "frequency", "frequency of the base alone on its feet", frequency),
            Parameter("base_mass", "mass", "mass of the base", mass),
            Parameter("base_damping", "number", "damping ratio of the base alone", damping),
        )
        return (cls(apart(model, parameters)),)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        sizes = typical(model, etfe)
        masses = sizes.device_mass * np.array([1.0, 4.0, 15.0])
        return grid(sizes.frequencies(35), masses, [0.03, 0.2])

    def unseen(self, model: Model, etfe: Etfe) -> Unseen:
        """A base that swings in the band, at least as heavy as the device."""
        sizes = typical(model, etfe)

        def own(share: Floats, shapes: Floats) -> Floats:
            return np.stack([shapes[:, 0], sizes.device_mass / share, shapes[:, 1]], axis=1)

        title, unit = "device's mass over the base's", 1 / sizes.device_mass
        return Unseen("number", title, 1.0, own, *modes(sizes), unit_size=unit)

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        frequency, mass, damping = self.own(values)
        mechanism = system.mechanism.with_frame(mass, *mount(mass, frequency, damping))
        return replace(system, mechanism=mechanism)
