"""The one large sentence: a stiffness to act on, or the plain reason why there is none."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.diagnosis.traced import UNEXPLAINED
from bayeshaptic.quantities import (
    decibel,
    estimate,
    percent,
    pretty_unit,
    pure,
    quantity,
    rounded_down,
)
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.recordings.units import is_assumed
from bayeshaptic.report.loop.words import in_short
from bayeshaptic.report.numbers.estimates import HEADLINE_RISKS, own_limit, read_off
from bayeshaptic.report.numbers.misfit import misfit_is_faint
from bayeshaptic.report.numbers.result import is_unexplained, tip_limit
from bayeshaptic.report.numbers.unstated import unstated
from bayeshaptic.report.objections import why_none
from bayeshaptic.report.status import CAUTION, UNTRUSTED, status_of

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed

# Below this the two ways to read the limit agree well enough for any use.
_AGREEMENT_DB = 0.3
_WORTH_NAMING = 0.001  # probability from which a crossing that binds is named
_FAINT = "slightly above noise"


@dataclass(frozen=True)
class Headline:
    """What a reader takes home.

    Attributes
    ----------
    status : {"safe", "caution", "untrusted"}
        "untrusted" where no stiffness can be recommended.
    sentence : str
        The recommendation, or that there is none and why.
    details : tuple of str
        Sentences below it: the tip, what limits it, what to beware of.
    stiffness : float or None
        The stiffness of the sentence, in the unit of the limit; None where there is none.
    risk : float or None
        The risk that the loop is unstable there; None where the measurement, not the model, sets
        the stiffness.
    doubts : tuple of str
        Why it is "caution", in a word or two each.
    """

    status: str
    sentence: str
    details: tuple[str, ...]
    stiffness: float | None = None
    risk: float | None = None
    doubts: tuple[str, ...] = ()


def headline(result: Result) -> Headline:
    """The recommendation of an analysis, or of what closing the loop returns."""
    analysis = result.analysis
    objections = why_none(result)
    if objections:
        return _untrusted(result, objections, result.closed)
    limit = analysis.limit
    risk = next((r for r in HEADLINE_RISKS if limit.safe(r) is not None), None)
    if risk is None:
        few = (
            "the sampler's draws are too few to state a risk of "
            f"{percent(HEADLINE_RISKS[-1])} (fewer than 20 of them lie below any such stiffness)"
        )
        return _untrusted(result, (few,))
    if limit.safe(risk) == math.inf:
        sure = percent(1 - risk)
        unlimited = f"Nothing limits the stiffness: any is stable with a probability of {sure}."
        return Headline(CAUTION, unlimited, (), doubts=("nothing limits it",))
    return _recommended(result, risk)


def _untrusted(
    result: Result, objections: tuple[str, ...], closed: Closed | None = None
) -> Headline:
    analysis, limit = result.analysis, result.analysis.limit
    sentence = f"Do not ship a stiffness from this report: {_joined(objections)}."
    middle, low, high = (limit.quantile(p) for p in (0.5, 0.05, 0.95))
    shown = estimate(middle, low, high, limit.unit)
    details = []
    if unstated(analysis) is not None:
        details.append("So no limit stands on this page.")
    elif analysis.in_loop is not None:
        details.append(
            f"As one mass with friction, followed through the feedback, it has a limit of {shown}."
        )
    else:
        details.append(
            f"The model's limit and its interval, {shown}, are not to be trusted; they stand below "
            "for comparison only."
        )
    own = own_limit(analysis)
    if own is not None and not has_feedback(analysis.notices):
        low, middle, high = own
        details.append(
            f"The measured response{read_off(result)} puts the limit at "
            f"{estimate(middle, low, high, limit.unit)}. What misleads the model may mislead that, "
            "too."
        )
    if closed is not None and closed.force is not None:
        details.append(in_short(closed))
    return Headline(UNTRUSTED, sentence, tuple(details))


def _recommended(result: Result, risk: float) -> Headline:
    analysis, closed = result.analysis, result.closed
    limit = analysis.limit
    safe = limit.safe(risk)
    assert safe is not None
    ends = (limit.quantile(0.05), limit.quantile(0.95))
    cap = _lower_witness(analysis, safe)
    stated = rounded_down(safe if cap is None else cap, limit.unit, *ends)
    if cap is None:
        sentence = (
            f"Render walls of at most {stated.with_level}: the risk that the loop is unstable "
            f"there is {percent(risk)}."
        )
    else:
        sentence = (
            f"Stay below {stated.with_level}: the measured response{read_off(result)} puts the "
            f"limit lower than the model does ({quantity(safe, limit.unit)} at {percent(risk)} "
            "risk), and the two must agree before the model's figure is used."
        )
    details = [] if closed is None else [text for text in (in_short(closed),) if text]
    details += _of_the_limit(analysis, stated.value, ends)
    doubts = _doubts(result, cap)
    if _FAINT in doubts:
        details.append(
            "The residual is slightly above the noise (reduced chi-square "
            f"{pure(analysis.fit.reduced_chi_square)}): something small may be missing from the "
            "model."
        )
    if is_unexplained(result):
        sentence += " Part of this recording remains unexplained; the interval is widened for it."
    warnings = warned_of(analysis)
    if warnings:
        details.append("Beware: " + " ".join(sentence_of(text) for text in warnings))
    known = risk if cap is None else None
    return Headline(status_of(doubts), sentence, tuple(details), stated.value, known, doubts)


def _doubts(result: Result, cap: float | None) -> tuple[str, ...]:
    """What makes a recommendation one to use with caution, each in a word or two."""
    analysis = result.analysis
    found = [n.topic for n in analysis.notices if n.level == "warning"]
    if is_unexplained(result):
        found.append(UNEXPLAINED)
    if result.closed is None and misfit_is_faint(analysis):
        found.append(_FAINT)
    if cap is not None:
        found.append("the measured response by itself is lower")
    return tuple(dict.fromkeys(found))


def warned_of(analysis: Analysis) -> tuple[str, ...]:
    """What an analysis warns of, in sentences."""
    return tuple(n.text for n in analysis.notices if n.level == "warning")


def _of_the_limit(analysis: Analysis, stated: float, ends: tuple[float, float]) -> list[str]:
    """What the stated stiffness is at the tip, what binds, and what its force is in."""
    details = []
    tip = tip_limit(analysis)
    if tip is not None and analysis.lever_m is not None:
        lever = analysis.lever_m
        there = rounded_down(stated, tip.unit, *ends, lever)
        details.append(
            f"At the tip, {quantity(lever, 'm')} from the axis, that is {there.with_level}."
        )
    details.append(_what_binds(analysis))
    if is_assumed("force", analysis.notices):
        unit = pretty_unit(analysis.model.force_unit)
        details.append(
            f"Nobody said the unit of the force: {unit} stands for whatever the command was "
            "recorded in."
        )
    return details


def _lower_witness(analysis: Analysis, safe: float) -> float | None:
    """The measurement's own lower end, where it contradicts the model on the unsafe side.

    Its median lies more than twice as far below the model's interval as its own 90 % interval
    reaches: where the phase runs along -180 degrees, that interval holds the truth in some 75 %,
    and disjoint intervals alone were a false alarm in 3 of 40 recordings of free LHIfAMs, with and
    without a second mode (none of 40 by this rule).
    """
    own = own_limit(analysis)
    if own is None or own[0] <= 0:
        return None
    low, middle, high = own
    far = middle * (high / middle) ** 2
    apart = far < analysis.limit.quantile(0.05)
    if not apart or decibel(safe) - decibel(middle) < _AGREEMENT_DB:
        return None
    return min(low, safe)


def _what_binds(analysis: Analysis) -> str:
    likely = [c for c in analysis.limit.crossings if c.probability >= _WORTH_NAMING]
    if len(likely) == 1:
        return f"What limits it: {likely[0].label}."
    named = [f"{c.label} ({percent(c.probability)})" for c in likely]
    return f"What limits it: {', or '.join(named)}."


def _joined(reasons: tuple[str, ...]) -> str:
    return reasons[0] if len(reasons) == 1 else "; and ".join(reasons)


def sentence_of(text: str) -> str:
    """`text` with a full stop."""
    text = text.strip()
    return text if text.endswith((".", "!", "?")) else text + "."
