"""The loop is later than declared: a bus, a filter's group delay, a second processor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.unseen import Unseen, alone
from bayeshaptic.models import LinearSystem, Model, Normal, Parameter
from bayeshaptic.recordings.response.etfe import Etfe


@register
@dataclass(frozen=True)
class ExtraDelay(LinearEffect):
    """The loop is later than declared, by more than a period too; or it is earlier."""

    name = "extra_delay"
    title = "extra delay in the loop"
    ties = ("actuator_lag", "position_filter")
    told_apart_by = "a wider band (a lag loses gain there, a delay does not), or an oscilloscope"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        if "delay_s" in model.names or any(isinstance(e, cls) for e in model.effects):
            return ()  # it is inferred anyway
        prior = Normal(0.0, 2 * etfe.period_s, low=-model.fixed["delay_s"])
        return (cls((Parameter("extra_delay_s", "time", "delay beyond the declared", prior),)),)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        later = etfe.period_s * np.array([0.1, 0.3, 0.6, 1.2, 2.0, 3.0])
        return np.append(later, -0.5 * model.fixed["delay_s"])[:, None]

    def unseen(self, model: Model, etfe: Etfe) -> Unseen:
        """Later or earlier by up to a period, but never before the command."""
        earliest = -min(model.fixed["delay_s"], etfe.period_s)
        title = "delay beyond the declared"
        return Unseen("time", title, etfe.period_s, alone, lowest=earliest)

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        (delay_s,) = self.own(values)
        return replace(system, delay_s=system.delay_s + delay_s)
