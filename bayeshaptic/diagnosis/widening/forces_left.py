"""What the forces that tests still see in a loop would do to the limit and to the parameters.

A test for a force says how strong the force is that fits what is left best, and how far a unit of
it moves the parameters that are fitted beside it.  In a loop the controller hides most of a force:
what tests see of it faintly may have moved the limit far, and a share of what they saw says little.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.inference.fit import Fit, search_box
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

_STEP = 1e-3  # of coordinates, for slopes of the limit


@dataclass(frozen=True)
class ForcesLeft:
    """The force that would move the limit the farthest, of those that tests see.

    Attributes
    ----------
    limit_log : float
        How far, in log stiffness, either way.
    parameters : ndarray, shape (P,)
        How far it moves them, natural values.
    """

    limit_log: float
    parameters: Floats


def forces_left(fit: Fit, tests: Iterable[Test]) -> ForcesLeft:
    """The worst of the forces that tests still see around a fit, each as strong as it is seen.

    To first order only, and no further than any device could go.

    Parameters
    ----------
    fit : Fit
    tests : iterable of Test
        Those without a force, or of which nobody asked what it moves, are left out.
    """
    seen = [test.force for test in tests if test.force is not None and test.force.moves]
    if not seen:
        return ForcesLeft(0.0, np.zeros_like(fit.theta))
    limit, natural = _slopes(fit)
    moved = np.array([np.multiply(force.strength, force.moves) for force in seen])
    far = np.abs(moved @ limit)
    worst = int(np.argmax(far))
    return ForcesLeft(float(far[worst]), natural * moved[worst])


def _slopes(fit: Fit) -> tuple[Floats, Floats]:
    """Of the limit's logarithm, and of each natural value, over its coordinate, shape (P,).

    Of a damper that is next to nothing to one side alone: on the other there is no device.
    """
    here, low, high = search_box(fit.model)
    phi = here.coordinate(fit.theta[None])[0]
    ends = np.array([np.minimum(phi + _STEP, high), np.maximum(phi - _STEP, low)])
    apart = np.eye(fit.model.size, dtype=bool)
    more, less = (here.natural(np.where(apart, end, phi)) for end in ends)
    sides = critical_stiffness(fit.model, np.concatenate([more, less])).samples
    upper, lower = np.log(np.maximum(sides, 1e-9)).reshape(2, -1)
    width = ends[0] - ends[1]
    return (upper - lower) / width, np.diag(more - less) / width
