"""Limits beyond any wall that a hand can tell from a rigid one: a slip of units, mostly."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.checks.against_device import says_the_mass

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

# Hands call a wall rigid from 15 to 42 kN/m on (H. Z. Tan and others, "Human factors for the design
# of force-reflecting haptic interfaces", ASME 1994), and a bar of steel, 1 cm^2 by 1 m, has 21
# MN/m: no haptic device needs a thousand kN/m. At a handle 0.1 m from the axis that is 10 kN m/rad.
_STIFFEST = {"N/m": 1e6, "N m/rad": 1e4}


def too_stiff(analysis: Analysis) -> str | None:
    """Why a limit is beyond any haptic device's; None where it is not, or a file says the mass.

    With a file the response was compared with that of the device.
    """
    limit = analysis.limit
    middle = limit.quantile(0.5)
    most = _STIFFEST.get(limit.unit)
    if most is None or not most < middle < math.inf or says_the_mass(analysis.device):
        return None
    return (
        f"the limit would be some {quantity(middle, limit.unit)}, which no haptic device has: the "
        f"unit of the position ({analysis.model.position_unit}) or of the force "
        f"({analysis.model.force_unit}) is in doubt"
    )
