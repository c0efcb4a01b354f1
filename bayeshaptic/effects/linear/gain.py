"""A force constant that is not what was declared: seen only where it changes during a recording."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.models import LinearSystem, LogNormal, Model, Parameter
from bayeshaptic.recordings.response.etfe import Etfe


class Gain(LinearEffect):
    """The commanded force is multiplied; part of the search for what drifts, not of the library.

    A constant gain cannot be seen, and does no harm: masses, dampers and springs take it up, and
    the critical stiffness is in units of the command.
    """

    name = "gain"
    title = "gain of the command"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        return (cls((Parameter("gain", "number", "gain of the command", LogNormal(1.0, 0.5)),)),)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        return np.ones((1, 1))

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        gain = values["gain"]
        return system.with_filter(gain[None, :], np.ones((1, len(gain))))
