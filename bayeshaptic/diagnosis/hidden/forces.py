"""Nonlinear forces that could hide, each by the spring, damper or gain that a fit takes it for.

A small force f(m) of a motion m, normal with standard deviation sigma, changes the response as the
linear force k m does that is closest to it, k = E[f m] / sigma^2 (R. C. Booton, "Nonlinear control
systems with random inputs", IRE Transactions on Circuit Theory 1, 1954).  The fitted parameters
contain k; the limit is that of the loop without it.  What is left of f, which no linear response
explains, is what the tests of the residual look for: they say how strong the force may be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.special import roots_hermitenorm

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.hidden.suspects import ForceSaid, Suspect
from bayeshaptic.diagnosis.residuals.residual import ForceSeen, Test
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.shapes import (
    ALONG,
    COMMAND,
    LOAD_VELOCITY,
    POSITION,
    STRETCH,
    STRETCH_VELOCITY,
    VELOCITY,
    Shape,
)
from bayeshaptic.effects.typical import BODY, MASSES, MOTOR
from bayeshaptic.effects.unseen import Unseen, alone
from bayeshaptic.models import LinearSystem, LogUniform, Model, Parameter
from bayeshaptic.models.response.mechanism import Link
from bayeshaptic.types import Floats

# Between which masses a force acts, and whether it is a damper's.
_ENDS = {
    VELOCITY: (MASSES[MOTOR], None, True),
    ALONG: (MASSES[MOTOR], None, True),
    LOAD_VELOCITY: (MASSES[BODY], None, True),
    POSITION: (MASSES[MOTOR], None, False),
    STRETCH: (MASSES[MOTOR], MASSES[BODY], False),
    STRETCH_VELOCITY: (MASSES[MOTOR], MASSES[BODY], True),
}
_STRENGTH = "unseen_force"


@dataclass(frozen=True)
class LinearStandIn:
    """The linear force that is closest to a nonlinear one.

    Attributes
    ----------
    name : str
    over : str
        What it is a function of.
    slope : float
        Of a strength of one: force over that motion.
    parameters : tuple of Parameter
        The strength.
    """

    name: str
    over: str
    slope: float
    parameters: tuple[Parameter, ...]

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        """The system with it."""
        gain = -self.slope * values[_STRENGTH]
        if self.over == COMMAND:
            return system.with_filter(1 - gain[None], np.ones((1, len(gain))))
        nothing, mechanism = np.zeros_like(gain), system.mechanism
        first, second, moving = _ENDS[self.over]
        other = mechanism.frame if second is None else second
        damping, spring = (gain, nothing) if moving else (nothing, gain)
        link = Link(first, other, damping, spring)
        return replace(system, mechanism=mechanism.with_link(link))


def force_suspects(
    model: Model, tests: Sequence[Test], found: Sequence[str], force_rms: float
) -> tuple[Suspect, ...]:
    """The nonlinear effects that `tests` looked for, without those that were `found`.

    Parameters
    ----------
    model : Model
        What was fitted.
    tests : sequence of Test
        Of the residual that is left.
    found : sequence of str
        Names of accepted effects.
    force_rms : float
        Of the command: no hidden force is larger.
    """
    seen = {test.name: _said(test) for test in tests if test.force is not None}
    suspects: list[Suspect] = []
    looked: set[str] = set()
    least = 1e-3  # of a slope in units of force: an even force has none
    for kind in effects("nonlinear"):
        known = [s for s in kind.tests if s.over in (*_ENDS, COMMAND)]
        places = [s for s in known if s.name in seen and s.name not in looked]
        looked |= {shape.name for shape in places}
        if kind.name in found:
            continue
        slopes = [slope_of(shape) for shape in places]
        pulls = [(s, a) for s, a in zip(places, slopes, strict=True) if abs(a) > least]
        for shape, slope in pulls:
            force = seen[shape.name]
            if not (force.sd > 0 and force.rms > 0):
                continue
            power = _power_of(shape)
            both = kind.signed or shape.over == COMMAND  # it may as well be the other way round
            suspects.append(
                Suspect(
                    kind.name,
                    kind.title,
                    kind.family,
                    getattr(kind, "told_apart_by", ""),
                    model,
                    _stand_in(kind.name, shape, slope / force.rms),
                    Unseen(
                        "force",
                        "force at the rms of the motion",
                        force_rms,
                        alone,
                        lowest=-force_rms if both else 0.0,
                    ),
                    ForceSaid(force.strength, force.sd),
                    counts=False,
                    share=1 / len(pulls),
                    place=shape.name,
                    shared="device" if np.isfinite(power) else "",
                    unit_size=force.rms**-power if np.isfinite(power) else 1.0,
                )
            )
    return tuple(suspects)


def _said(test: Test) -> ForceSeen:
    """What a test says of the strength of its force.

    Where a law was taken off it can say no better than that law is known.  A law is an
    approximation, and what it leaves raises the tests of other forces.  Their thresholds are higher
    then, and what is below them is no evidence of a second force.
    """
    assert test.force is not None
    doubt = max(1.0, test.threshold / thresholds.two_sided())
    return replace(test.force, sd=doubt * test.force.sd)


def _power_of(shape: Shape) -> float:
    """What power of its variable a force is; not a number where it is none, or is of two."""
    if shape.over == ALONG:
        return np.nan
    one, two, four = np.abs(shape.force(np.array([1.0, 2.0, 4.0])))
    alike = min(one, two, four) > 0 and np.isclose(two / one, four / two, rtol=1e-6)
    return float(np.log2(two / one)) if alike else np.nan


@cache
def slope_of(shape: Shape) -> float:
    """E[f(z) z] of a standard normal z; of damping along the way E[f(z)], of its mean."""
    nodes = 200
    z, weight = roots_hermitenorm(nodes)
    times = 1.0 if shape.over == ALONG else z
    return float(np.sum(weight * shape.force(z) * times) / weight.sum())


def _stand_in(name: str, shape: Shape, slope: float) -> LinearStandIn:
    # The prior of the strength is that of `Sizes`; this one is never asked.
    prior = LogUniform(1e-12, 1e12)
    strength = Parameter(_STRENGTH, "force", "strength of the force", prior)
    return LinearStandIn(name, shape.over, slope, (strength,))
