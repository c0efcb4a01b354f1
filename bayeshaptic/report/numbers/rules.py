"""The classical rules as curves over a wall's damping, for one case of a device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.report.numbers.estimates import RULE_DRAWS
from bayeshaptic.stability.rules import (
    ground_damping,
    passivity_limit,
    quantisation_limit,
    rigid_limit,
)

if TYPE_CHECKING:
    from bayeshaptic.stability.cases import Case


@dataclass(frozen=True)
class Rules:
    """What the rules need to know of a device, at the medians of one case.

    Attributes
    ----------
    label : str
        The case: the one with the least damping to the ground.
    damping, delay_s, period_s : float
    friction : float or None
        Coulomb friction, where it is known.
    resolution : float or None
        One encoder count.
    """

    label: str
    damping: float
    delay_s: float
    period_s: float
    friction: float | None = None
    resolution: float | None = None

    def rigid(self, virtual: NDArray[Any]) -> NDArray[Any]:
        """Stability of a rigid device with virtual damping."""
        return rigid_limit(self.damping, self.delay_s, self.period_s, virtual)

    def passive(self, virtual: NDArray[Any]) -> NDArray[Any]:
        """Colgate and Schenkel's passivity with virtual damping."""
        return passivity_limit(self.damping, self.period_s, virtual)

    @property
    def quantised(self) -> float | None:
        """Abbott and Okamura's limit; None where friction or resolution is not known."""
        if self.friction is None or self.resolution is None:
            return None
        limit = quantisation_limit(self.damping, self.friction, self.resolution, self.period_s)
        return float(limit)


def rules_of(
    cases: Sequence[Case], friction: float | None = None, resolution: float | None = None
) -> Rules:
    """The rules for the case with the least damping, which they ask the smallest stiffness of."""
    found = []
    for case in cases:
        system = case.model.system(case.draws[:: max(len(case.draws) // RULE_DRAWS, 1)])
        middle = float(np.median(ground_damping(system)))
        assert case.model.period_s is not None
        delay = float(np.median(system.delay_s))
        found.append(Rules(case.label, middle, delay, case.model.period_s, friction, resolution))
    return min(found, key=lambda rules: rules.damping)
