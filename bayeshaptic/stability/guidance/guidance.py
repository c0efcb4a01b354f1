"""What a designer may read off a posterior: where doubt comes from, and what would raise K_CR."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bayeshaptic.models.model import Model
from bayeshaptic.stability.guidance.elasticities import Elasticities, elasticities
from bayeshaptic.stability.guidance.shares import VarianceShares, variance_shares
from bayeshaptic.stability.guidance.sweep import DRAWS, Sweep, sweep
from bayeshaptic.stability.rules import ground_damping
from bayeshaptic.stability.walls.loops import loops_of

_STIFFNESSES = ("kc", "ks")  # cable pretension; the link that the hand holds
_DAMPERS = ("b1", "b")  # where damping can be added


@dataclass(frozen=True)
class Guidance:
    """Shares of the variance, elasticities and sweeps of one device.

    Attributes
    ----------
    shares : VarianceShares
    elasticities : tuple of Elasticities
        Of each crossing that may bind, the most probable first.
    sweeps : tuple of Sweep
    """

    shares: VarianceShares
    elasticities: tuple[Elasticities, ...]
    sweeps: tuple[Sweep, ...]


def guidance(source: Any, slow: bool = False) -> Guidance:
    """Everything of this page for a posterior.

    Parameters
    ----------
    source : Posterior, Case or Analysis
    slow : bool
        With few draws: for models that take long to look at.
    """
    fewer = 8 if slow else 1
    return Guidance(
        variance_shares(source, 2400 // fewer),
        elasticities(source, 160 // fewer),
        usual_sweeps(source, DRAWS // fewer),
    )


def usual_sweeps(source: Any, draws: int = DRAWS) -> tuple[Sweep, ...]:
    """K_CR over what a designer may change.

    That is the stiffness of the transmission and of the link, as far as the model has them, and
    damping added to the ground, up to four times what is there.

    Parameters
    ----------
    source : Posterior, Case or Analysis
    draws : int
        How many parameter vectors to look at.
    """
    loops = loops_of(source, draws=draws)
    model: Model = loops.model
    found = [sweep(source, name, draws=draws) for name in _STIFFNESSES if name in model.names]
    damper = next((name for name in _DAMPERS if name in model.names), None)
    total = float(np.median(ground_damping(model.system(loops.draws))))
    if damper is not None and total > 0:
        most_added = 4.0  # times what there is
        points = 25
        added = np.linspace(0.0, most_added * total, points)
        found.append(sweep(source, damper, add=added, draws=draws))
    return tuple(found)
