"""What fitted forces leave open: their strengths, and how far the limit goes with them."""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.trials.forces.slopes import spread
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.inference.fit import search_box
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats


def in_doubt(tryout: Tryout, point: Point) -> tuple[list[float], float]:
    """Standard deviations of the strengths, and of log K_CR because of strengths and shapes.

    Parameters
    ----------
    tryout : Tryout
    point : Point
        Fitted.

    Returns
    -------
    strengths : list of float, one a force
    limit_log_sd : float
        1 at most.
    """
    covariance, along = spread(tryout, point)
    tuned = [len(one.effect.tuned) for one in point.forces]
    strengths = np.cumsum([0, *(1 + count for count in tuned[:-1])])
    here, low, high = search_box(tryout.model)
    step = 1e-3
    sides = here.coordinate(point.theta[None]) + step * np.concatenate([along.T, -along.T])
    more, less = _log_limits(tryout, here.natural(np.clip(sides, low, high))).reshape(2, -1)
    slope = (more - less) / (2 * step)
    by_law = _by_law(tryout, point, thresholds.LAW_SD * float(np.linalg.norm(slope[strengths])))
    relative = np.sqrt(np.diag(covariance)[strengths] + thresholds.LAW_SD**2)
    sds = np.minimum(relative, 0.5) * [abs(one.strength) for one in point.forces]
    return sds.tolist(), min(float(np.sqrt(slope @ covariance @ slope + by_law**2)), 1.0)


def _by_law(tryout: Tryout, point: Point, by_slopes: float) -> float:
    """How far log K_CR goes with the error of a law.

    The slope of the limit at the fit is used, within bounds: at least, in proportion, the way that
    the linear parameters went when the forces were taken off, and at most twice that.  The slope
    alone holds no further than the force is known, perhaps a thousandth of the law's error.  For
    three of nine forces it said 0.04, 0.05 and 0.61, where fits with that much more and less of the
    force moved the limit by 0.23, 0.93 and 0.02; the bounded value is 0.21, 1.9 and 0.02.
    """
    here, *ends = search_box(tryout.model)
    low, high = (here.natural(end[None])[0] for end in ends)
    moved = thresholds.LAW_SD * (point.theta - tryout.simulation.usual)
    limits = _log_limits(
        tryout, np.clip(point.theta + np.outer([0.0, -1.0, 1.0], moved), low, high)
    )
    on_the_way = float(np.abs(limits - limits[0]).max())
    return min(max(by_slopes, on_the_way), 2 * on_the_way)


def _log_limits(tryout: Tryout, theta: Floats) -> Floats:
    return np.log(np.maximum(critical_stiffness(tryout.model, theta).samples, 1e-9))
