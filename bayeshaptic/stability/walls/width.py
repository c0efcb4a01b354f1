"""What is told of a region of stable walls: its boundary at a risk, and how wide it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.types import Floats


@dataclass(frozen=True, eq=False)
class Boundary:
    """The stiffness that is unstable with a given probability, over damping.

    Attributes
    ----------
    risk : float
    damping : ndarray, shape (J,)
        Ascending, in `KbRegion.damping_unit`.
    stiffness : ndarray, shape (J,)
        In `KbRegion.unit`; 0 where that probability is exceeded at any stiffness.
    """

    risk: float
    damping: Floats
    stiffness: Floats


@dataclass(frozen=True, eq=False)
class ZWidth:
    """How wide the range of walls is that may be rendered at a given risk.

    Each wall of the range by itself is unstable with at most the probability `risk`.

    Attributes
    ----------
    boundary : Boundary
    stiffness, at_damping : float
        The stiffest wall, and the damping that it needs.
    damping : float
        The largest damping, at a stiffness near zero.
    area : float
        Of the region below the boundary, stiffness times damping.
    """

    boundary: Boundary
    stiffness: float
    at_damping: float
    damping: float
    area: float


def width_of(boundary: Boundary) -> ZWidth:
    """The Z-width that a boundary tells; its last stiffness above zero is at the largest damping.

    References
    ----------
    J. E. Colgate and J. M. Brown, "Factors affecting the Z-Width of a haptic display", IEEE
    International Conference on Robotics and Automation, 1994, who ask for passivity; here it is
    stability of the coupled loop.
    """
    stiffness, damping = boundary.stiffness, boundary.damping
    best = int(np.argmax(stiffness))
    some = np.flatnonzero(stiffness > 0)
    largest = float(damping[some[-1]]) if len(some) else 0.0
    area = float(np.trapezoid(stiffness, damping))
    return ZWidth(boundary, float(stiffness[best]), float(damping[best]), largest, area)
