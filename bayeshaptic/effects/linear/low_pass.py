"""Low-passes in the loop: an actuator that follows late, a filter on the position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import apart, grid
from bayeshaptic.effects.unseen import Unseen, alone, combined
from bayeshaptic.models import LinearSystem, LogNormal, Model, Parameter
from bayeshaptic.recordings.response.etfe import Etfe


@register
@dataclass(frozen=True)
class ActuatorLag(LinearEffect):
    """The force follows the command by 1/(1 + s lag)^order.

    Attributes
    ----------
    order : int
        Equal stages; the lag is that of each.
    """

    order: int = 1

    name = "actuator_lag"
    title = "actuator lag"
    ties = ("position_filter", "extra_delay")
    told_apart_by = "a probe on the motor's current, or an accelerometer beside the encoder"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        return tuple(
            cls(apart(model, (cls._lag(etfe.period_s / order),)), order) for order in (1, 2, 3)
        )

    @staticmethod
    def _lag(median: float) -> Parameter:
        return Parameter("lag_s", "time", "time constant of the actuator", LogNormal(median, 1.0))

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        return etfe.period_s / self.order * np.geomspace(0.1, 10, 9)[:, None]

    def unseen(self, model: Model, etfe: Etfe) -> Unseen | None:
        """One stage; more of them look the same while they are fast."""
        if self.order > 1:
            return None
        return Unseen("time", "time constant", etfe.period_s, alone)

    def on_the_other_side(
        self, model: Model, etfe: Etfe, own: Floats
    ) -> tuple[LinearEffect, Floats] | None:
        """The filter of the position of as many poles; three are none that is known."""
        filters = PositionFilter.candidates(model, etfe)
        if self.order > len(filters):
            return None
        damping = [1.0] * (self.order - 1)
        return filters[self.order - 1], np.array([1 / (2 * np.pi * own[0]), *damping])

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        (lag,) = self.own(values)
        for _ in range(self.order):
            system = system.with_filter(*_first_order(lag))
        return system


@register
@dataclass(frozen=True)
class PositionFilter(LinearEffect):
    """A low-pass on the position before it is sampled: order 1, or 2 with a damping ratio.

    With a damping ratio well below 0.7 it is as well a resonance of the actuator or the sensor.

    Attributes
    ----------
    order : int
    """

    order: int = 1

    name = "position_filter"
    title = "low-pass on the position"
    ties = ("actuator_lag", "extra_delay")
    told_apart_by = ActuatorLag.told_apart_by

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        median = 0.5 / (np.pi * etfe.period_s)
        cut_off = Parameter(
            "filter_hz", "frequency", "cut-off of the position filter", LogNormal(median, 1.0)
        )
        damping = Parameter(
            "filter_damping", "number", "damping ratio of the position filter", LogNormal(0.7, 0.5)
        )
        return cls(apart(model, (cut_off,)), 1), cls(apart(model, (cut_off, damping)), 2)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        cut_offs = np.geomspace(0.02, 2, 9) / etfe.period_s
        return grid(cut_offs) if self.order == 1 else grid(cut_offs, [0.1, 0.35, 0.9])

    def unseen(self, model: Model, etfe: Etfe) -> Unseen | None:
        """Two poles; one is what an actuator's lag is."""
        if self.order == 1:
            return None

        def own(lag: Floats, shapes: Floats) -> Floats:
            return np.stack([1 / (2 * np.pi * lag), shapes[:, 0]], axis=1)

        title = "1 / (2 pi cut-off)"
        return Unseen("time", title, etfe.period_s, own, *combined((0.35, 0.7, 1.4)))

    def on_the_other_side(
        self, model: Model, etfe: Etfe, own: Floats
    ) -> tuple[LinearEffect, Floats] | None:
        """The lag of as many stages, which of two poles are equal."""
        lag = ActuatorLag.candidates(model, etfe)[self.order - 1]
        return lag, np.array([1 / (2 * np.pi * own[0])])

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        cut_off, *damping = self.own(values)
        lag = 1 / (2 * np.pi * cut_off)
        if self.order == 1:
            return system.with_filter(*_first_order(lag), of_position=True)
        one = np.ones_like(lag)
        poles = np.stack([one, 2 * damping[0] * lag, lag**2])
        return system.with_filter(one[None], poles, of_position=True)


def _first_order(lag: Floats) -> tuple[Floats, Floats]:
    one = np.ones_like(lag)
    return one[None], np.stack([one, lag])
