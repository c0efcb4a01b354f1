"""Undeclared delay in the loop: a bus, a filter's group delay, a second processor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.models import HalfNormal, LinearSystem, Model, Parameter
from bayeshaptic.recordings.etfe import Etfe


@register
class ExtraDelay(LinearEffect):
    """The loop is later than declared, by more than a period too."""

    name = "extra_delay"
    title = "extra delay in the loop"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        if "delay_s" in model.names:  # a delay that is inferred anyway
            return ()
        prior = HalfNormal(2 * etfe.period_s)
        return (cls((Parameter("extra_delay_s", "time", "delay beyond the declared", prior),)),)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        return etfe.period_s * np.array([0.2, 0.6, 1.2, 2.5])[:, None]

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        return replace(system, delay_s=system.delay_s + values["extra_delay_s"])
