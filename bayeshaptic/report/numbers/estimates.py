"""Every estimate of the limit side by side: posterior, least squares, measurement, rules."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.listed import listed
from bayeshaptic.report.numbers.result import families_of
from bayeshaptic.report.numbers.rules import rules_of
from bayeshaptic.types import Floats

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

QUANTILES = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
RISKS = (0.05, 0.01, 0.001)
HEADLINE_RISKS = (0.01, 0.05)  # a stiffness is recommended at the first that the draws can state
_OURS = "model, with its uncertainty"


@dataclass(frozen=True)
class Witness:
    """One estimate of the critical stiffness, in the unit of the analysis' limit.

    Attributes
    ----------
    key : str
        "posterior", "least_squares", "etfe" (the response as measured), "corrected" (after what
        the model says was taken off it), or the name of a rule.
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


def finite(value: Any) -> float | None:
    """A plain float, or None for a missing or infinite number."""
    return None if value is None or not math.isfinite(value) else float(value)


def least_squares_limit(analysis: Analysis) -> float | None:
    """Critical stiffness at the least-squares parameters: the paper's single number."""
    from bayeshaptic.stability.critical import critical_stiffness

    return finite(critical_stiffness(analysis.model, analysis.fit.theta).value)


def own_limit(analysis: Analysis) -> tuple[float, float, float] | None:
    """5, 50 and 95 per cent of the limit read from the measurement alone; None without one."""
    own = analysis.etfe_limit
    if own is None or own.q05 is None or own.q50 is None or own.q95 is None:
        return None
    return own.q05, own.q50, own.q95


def witnesses(result: Result) -> tuple[Witness, ...]:
    """Every estimate of the limit: model, least squares, measurement, closed-form rules.

    Parameters
    ----------
    result : Analysis, or what closing the loop returns
    """
    analysis = result.analysis
    limit = analysis.limit
    low, middle, high = (finite(limit.quantile(p)) for p in (0.05, 0.5, 0.95))
    fitted = least_squares_limit(analysis)
    found = [
        Witness("posterior", _OURS, "median and 90 % interval of the posterior", middle, low, high),
        Witness("least_squares", "deterministic fit", "least squares, one number", fitted),
    ]
    return (*found, *_measured(result), *_rules(analysis))


def correction(result: Result) -> str:
    """What was done to the response before its crossing was read off; empty where nothing was."""
    closed = result.closed
    if closed is None or closed.force is not None or closed.analysis.etfe is closed.base.etfe:
        return ""
    if "time-varying" in families_of(result):
        return "in the worst part of the recording"
    found = [e for e in closed.effects if e.family in ("nonlinear", "measurement")]
    if not found:
        return ""
    helped = " with the model's help" if any(e.family == "nonlinear" for e in found) else ""
    were = "was" if len(found) == 1 else "were"
    return f"after {listed(e.title for e in found)} {were} taken off it{helped}"


def read_off(result: Result) -> str:
    """How the crossing that stands beside the model was read: after "the measured response"."""
    changed = correction(result)
    return f", {changed}," if changed else " itself, without a model,"


def _measured(result: Result) -> tuple[Witness, ...]:
    """The response's own crossing, as it was measured and as the model corrected it."""
    changed = correction(result)
    found = []
    own = own_limit(result.measured)
    if own is not None:
        low, middle, high = own
        remark = "the crossing read from the response, no model"
        found.append(Witness("etfe", "measurement alone", remark, middle, low, high))
    mended = own_limit(result.analysis) if changed else None
    if mended is not None and (own is None or not np.allclose(mended, own, rtol=1e-3)):
        low, middle, high = mended
        label = "measurement, worst part" if "part of" in changed else "measurement, corrected"
        remark = f"the crossing read from the response {changed}"
        found.append(Witness("corrected", label, remark, middle, low, high))
    caveat = getattr(result.analysis.etfe_limit, "caveat", None)
    if found and caveat:
        found[-1] = replace(found[-1], remark=f"{found[-1].remark}; {caveat}")
    return tuple(found)


def _rules(analysis: Analysis) -> tuple[Witness, ...]:
    """The closed-form rules, medians over the draws.

    They know a rigid device only: how far they are off is not in the posterior, so that an interval
    of theirs would only mislead.
    """
    rules = rules_of(analysis.model, analysis.posterior.draws)

    def rule(key: str, label: str, remark: str, limit: Floats) -> Witness:
        return Witness(key, label, remark, finite(float(limit)))

    diaz = "a rigid device, Diaz and Gil (2010), equation (19)"
    colgate = "a rigid device without delay, Colgate and Schenkel (1997)"
    return (
        rule("rigid_rule", "rule b/(T/2 + td)", diaz, rules.rigid()),
        rule("passivity", "passivity 2b/T", colgate, rules.passive()),
    )
