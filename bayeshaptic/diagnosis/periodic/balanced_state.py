"""What the loop knows of a periodic recording, and effects as they are accepted there."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced
from bayeshaptic.diagnosis.state import Accepted, Estimate, State
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class BalancedState(State):
    """What the loop knows of a periodic recording.

    Attributes
    ----------
    part, whole : Balanced
        Model and internal forces fitted to the lines to fit, and to all lines.
    """

    part: Balanced = field(kw_only=True)
    whole: Balanced = field(kw_only=True)


def sized(accepted: tuple[Accepted, ...], whole: Balanced) -> tuple[Accepted, ...]:
    """Forces with the strengths that all lines give them, and what these leave open of the limit.

    The last force has what all of them together leave open.
    """
    spread = _limit_log_sd(whole)
    titles = [basis.title for basis in whole.forces]
    last = titles[-1] if titles else ""
    found = []
    for effect in accepted:
        if effect.title in titles:
            index = titles.index(effect.title)
            sd = float(whole.strength_sd[index]) * max(whole.rms(), 1.0)
            estimate = Estimate(float(whole.strength[index]), sd, whole.forces[index].unit)
            own = spread if effect.title == last else 0.0
            # What another law would make of the limit is not in that.
            own = max(own, effect.limit_log_sd) if effect.ties else own
            effect = replace(effect, estimates={"strength": estimate}, limit_log_sd=own)
        found.append(effect)
    return tuple(found)


def _limit_log_sd(whole: Balanced) -> float:
    """Standard deviation of log K_CR because of the strengths, which the parameters follow."""
    if whole.covariance is None or whole.along is None:
        return 0.0
    covariance = max(whole.rms(), 1.0) ** 2 * whole.covariance
    covariance = covariance + np.diag((thresholds.LAW_SD * whole.strength) ** 2)
    step = 1e-2 * np.sqrt(np.diag(covariance))
    here = coordinates(whole.model)
    far = (whole.along * step).T
    sides = here.coordinate(whole.theta[None]) + np.concatenate([far, -far])
    more, less = np.log(_limits(whole, here.natural(sides))).reshape(2, -1)
    slope = (more - less) / (2 * step)
    return min(float(np.sqrt(slope @ covariance @ slope)), 1.0)


def _limits(whole: Balanced, theta: Floats) -> Floats:
    return np.maximum(critical_stiffness(whole.model, theta).samples, 1e-9)
