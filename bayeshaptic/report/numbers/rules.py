"""The classical rules beside a limit, and as curves over a wall's damping."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.stability.rules import (
    ground_damping,
    passivity_limit,
    quantisation_limit,
    rigid_limit,
)
from bayeshaptic.types import Floats

if TYPE_CHECKING:
    from bayeshaptic.models.model import Model
    from bayeshaptic.stability.cases import Case


@dataclass(frozen=True)
class Rules:
    """What the rules need to know of a device, for one case; rules are medians over its draws.

    Attributes
    ----------
    label : str
        The case.
    dampings, delays_s : ndarray, shape (D,)
        Draws of the damping to the ground and of the delay.
    period_s : float
    friction : float or None
        Coulomb friction, where it is known.
    resolution : float or None
        One encoder count.
    """

    label: str
    dampings: Floats = field(repr=False)
    delays_s: Floats = field(repr=False)
    period_s: float
    friction: float | None = None
    resolution: float | None = None

    @property
    def damping(self) -> float:
        """The median of the damping to the ground."""
        return float(np.median(self.dampings))

    def rigid(self, virtual: ArrayLike = 0.0) -> Floats:
        """Stability of a rigid device with virtual damping, in its shape."""
        beside = np.asarray(virtual, float)
        device = self.dampings, self.delays_s, self.period_s
        # One after the other: all at once are a hundred megabytes.
        medians = [np.median(rigid_limit(*device, one)) for one in beside.ravel()]
        return np.reshape(medians, beside.shape)

    def passive(self, virtual: ArrayLike = 0.0) -> Floats:
        """Colgate and Schenkel's passivity with virtual damping, in its shape."""
        return passivity_limit(self.damping, self.period_s, virtual)

    @property
    def quantised(self) -> float | None:
        """Abbott and Okamura's limit; None where friction or resolution is not known."""
        if self.friction is None or self.resolution is None:
            return None
        limit = quantisation_limit(self.damping, self.friction, self.resolution, self.period_s)
        return float(limit)


def rules_of(model: Model, draws: Floats, label: str = "") -> Rules:
    """The rules for draws (D, P) of a model whose period is known."""
    assert model.period_s is not None
    system = model.system(draws)
    return Rules(label, ground_damping(system), np.asarray(system.delay_s), model.period_s)


def least_damped(cases: Sequence[Case], friction: float | None, resolution: float | None) -> Rules:
    """The rules for the case with the least damping, which they ask the smallest stiffness of."""
    every = (rules_of(case.model, case.draws, case.label) for case in cases)
    least = min(every, key=lambda rules: rules.damping)
    return replace(least, friction=friction, resolution=resolution)
