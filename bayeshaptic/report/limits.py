"""Every estimate of the stability limit side by side: posterior, least squares, measurement, rules."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

RISKS = (0.05, 0.01, 0.001)
RULE_DRAWS = 4000


@dataclass(frozen=True)
class Witness:
    """One estimate of the critical stiffness, in the unit of the analysis' limit.

    Attributes
    ----------
    key : str
        "posterior", "least_squares", "etfe", or the name of a rule.
    label, remark : str
        What it is, short for a figure and in a sentence for the page.
    low, middle, high : float or None
        5, 50 and 95 per cent quantile; the ends are None where there is one number only.
    """

    key: str
    label: str
    remark: str
    middle: float | None
    low: float | None = None
    high: float | None = None


def decibel(stiffness: float) -> float:
    """20 log10 of a stiffness in SI units; minus infinity for zero."""
    return 20 * math.log10(stiffness) if stiffness > 0 else -math.inf


def finite(value: Any) -> float | None:
    """A plain float, or None for a missing or infinite number."""
    return None if value is None or not math.isfinite(value) else float(value)


def least_squares_limit(analysis: Analysis) -> float | None:
    """Critical stiffness at the least-squares parameters: the paper's single number."""
    from bayeshaptic.stability.critical import critical_stiffness

    return finite(critical_stiffness(analysis.model, analysis.fit.theta).value)


def witnesses(analysis: Analysis) -> tuple[Witness, ...]:
    """The posterior, least squares, the measurement's own crossing, and the closed-form rules."""
    limit, own = analysis.limit, analysis.etfe_limit
    low, middle, high = (finite(limit.quantile(p)) for p in (0.05, 0.5, 0.95))
    found = [
        Witness("posterior", "posterior", "the model with its uncertainty", middle, low, high),
        Witness(
            "least_squares", "least squares", "the same model, one number",
            least_squares_limit(analysis),
        ),
    ]  # fmt: skip
    if own is not None and own.q50 is not None:
        found.append(
            Witness(
                "etfe", "measurement alone", "the crossing read from the response, no model",
                finite(own.q50), finite(own.q05), finite(own.q95),
            )
        )  # fmt: skip
    return (*found, *_rules(analysis))


def _rules(analysis: Analysis) -> tuple[Witness, ...]:
    """The closed-form rules at every draw; they know a rigid device only."""
    from bayeshaptic.stability.rules import ground_damping, passivity_limit, rigid_limit

    draws = analysis.posterior.draws
    system = analysis.model.system(draws[:: max(len(draws) // RULE_DRAWS, 1)])
    damping, period = ground_damping(system), analysis.etfe.period_s
    rules = (
        ("rigid_rule", "rule b/(T/2 + td)", "a rigid device, Diaz and Gil (2010), equation (19)",
         rigid_limit(damping, system.delay_s, period)),
        ("passivity", "passivity 2b/T", "a rigid device without delay, Colgate and Schenkel (1997)",
         passivity_limit(damping, period)),
    )  # fmt: skip
    found = []
    for key, label, remark, values in rules:
        low, middle, high = (finite(v) for v in np.quantile(values, (0.05, 0.5, 0.95)))
        found.append(Witness(key, label, remark, middle, low, high))
    return tuple(found)
