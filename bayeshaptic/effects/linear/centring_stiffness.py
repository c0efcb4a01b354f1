"""A spring to the frame: a cable, a counterweight, gravity in a pendulum."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import MASSES, MOTOR, apart, typical
from bayeshaptic.effects.unseen import Unseen, alone
from bayeshaptic.models import LinearSystem, LogNormal, Model, Parameter
from bayeshaptic.models.response.mechanism import Link
from bayeshaptic.recordings.response.etfe import Etfe


@register
@dataclass(frozen=True)
class CentringStiffness(LinearEffect):
    """A spring from the motor's mass to the frame.

    It shows at the lowest frequencies, where everything moves together: there the hand's own
    spring, if somebody holds the device, is as good an explanation.
    """

    name = "centring_stiffness"
    title = "centring stiffness"
    ties = ("kh",)
    told_apart_by = "measure the device with nobody holding it"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        sizes = typical(model, etfe)
        # The spring that brings the whole device to resonance a little above the band's low end.
        median = sizes.device_mass * (2 * np.pi * 2 * sizes.low_hz) ** 2
        prior = LogNormal(median, 2.0)
        parameter = Parameter("centring_stiffness", "stiffness", "spring to the frame", prior)
        return (cls(apart(model, (parameter,))),)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        sizes = typical(model, etfe)
        rate = 2 * np.pi * sizes.low_hz * np.geomspace(0.3, 30, 9)
        return (sizes.device_mass * rate**2)[:, None]

    def unseen(self, model: Model, etfe: Etfe) -> Unseen:
        """Up to what brings the whole device to resonance at ten times the band's low end."""
        sizes = typical(model, etfe)
        largest = sizes.device_mass * (20 * np.pi * sizes.low_hz) ** 2
        return Unseen("stiffness", "spring to the frame", largest, alone)

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        (stiffness,) = self.own(values)
        mechanism = system.mechanism
        spring = Link(MASSES[MOTOR], mechanism.frame, np.zeros_like(stiffness), stiffness)
        return replace(system, mechanism=mechanism.with_link(spring))
