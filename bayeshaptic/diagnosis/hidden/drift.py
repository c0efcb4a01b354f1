"""Parameters that could drift during a recording: a ramp that nobody sees, the limit at its end.

A ramp leaves the mean where it is, and what the fit finds is the mean.  The response then differs
between the parts of the recording, by a third in power of what a steady change of half the ramp
would do; the worst moment is at one of the ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.hidden.regression import Around, log_limits
from bayeshaptic.diagnosis.hidden.sizes import MOST, SEEN, ladder
from bayeshaptic.diagnosis.hidden.weighed import KEPT, PAIRED, Weighed
from bayeshaptic.models import Model
from bayeshaptic.models.structures import HAND
from bayeshaptic.numerics.weights import systematic
from bayeshaptic.types import Bools, Floats


@dataclass(frozen=True)
class Drift:
    """A group of parameters that may change together.

    Attributes
    ----------
    name, title : str
    parameters : tuple of str
    """

    name: str
    title: str
    parameters: tuple[str, ...]
    family = "time-varying"
    told_apart_by = "a shorter recording, and the same again after a pause"


def drifts(model: Model) -> tuple[Drift, ...]:
    """What may drift in `model`: the grip, where there is one."""
    found = Drift("grip_drift", "a grip that changes during the recording", HAND)
    return (found,) if set(HAND) & set(model.names) else ()


def weigh_drift(drift: Drift, known: Around, rng: np.random.Generator) -> Weighed:
    """The posterior of the size of a ramp, as a logarithm, where tests see none.

    Parameters
    ----------
    drift : Drift
    known : Around
    rng : numpy.random.Generator
    """
    theta, slope = known.theta, known.slope
    member = np.isin(known.model.names, drift.parameters)
    stretch = np.where(known.here.log, 1.0, theta / known.here.scale)
    change = slope[:, member] @ stretch[member]
    # Half of the ramp at the ends, t^2 on average a third.
    sd = 2 * np.sqrt(3) / np.sqrt(max(float(change @ change), 1e-300))
    largest = 1.0  # log change from the beginning to the end
    seen = min(SEEN * sd, largest / MOST)
    steps = 60
    strength = seen * ladder(steps)
    likelihood = np.exp(-0.5 * (strength / sd) ** 2)
    kept = strength[systematic(likelihood, KEPT, rng)]
    factor = _worst(known, member, kept)
    nothing = np.zeros((KEPT // PAIRED, len(known.left)))
    return Weighed(
        drift.name,
        drift.title,
        drift.family,
        drift.told_apart_by,
        "change of the grip over the recording, as a logarithm",
        "",
        place="",
        shared="",
        share=1.0,
        log_evidence=float(np.log(likelihood.mean())),
        pareto_k=-np.inf,
        strength=kept,
        log_factor=factor,
        changes=nothing,
        size=kept,
        shape=np.zeros((KEPT, 0)),
    )


def _worst(known: Around, member: Bools, ramp: Floats) -> Floats:
    """ln K_CR at the worse end of a ramp over that of its middle, shape (KEPT,)."""
    draws = known.draws[np.arange(len(ramp)) % len(known.draws)]
    ends = [
        log_limits(known.model, draws * np.where(member, np.exp(sign * ramp / 2)[:, None], 1.0))
        for sign in (-1, 1)
    ]
    own = log_limits(known.model, draws)
    with np.errstate(invalid="ignore"):
        factor = np.minimum(*ends) - own
    return np.where(np.isfinite(factor), factor, 0.0)
