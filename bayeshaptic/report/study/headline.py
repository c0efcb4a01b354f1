"""The one large sentence of a study: the stiffness to render whoever holds the device."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

from bayeshaptic.quantities import percent, quantity, rounded_down
from bayeshaptic.report.headline import Headline, headline, sentence_of, warned_of
from bayeshaptic.report.listed import listed
from bayeshaptic.report.numbers.cases import is_free
from bayeshaptic.report.numbers.estimates import HEADLINE_RISKS
from bayeshaptic.report.numbers.result import is_unexplained
from bayeshaptic.report.status import CAUTION, UNTRUSTED, status_of
from bayeshaptic.report.study.words import missing
from bayeshaptic.stability.cases import CONFIGURATION, FREE, HELD, NEW_PERSON

if TYPE_CHECKING:
    from bayeshaptic.stability.cases import Binding
    from bayeshaptic.study.analysed import Analysed
    from bayeshaptic.study.analysis import StudyAnalysis

_Parts: TypeAlias = "Sequence[tuple[Analysed, Headline]]"  # recordings, and what their pages say

HOLDERS = {
    FREE: "nobody holds it",
    HELD: "one of these people holds it",
    NEW_PERSON: "a person not yet seen holds it",
    CONFIGURATION: "somebody holds it in a configuration that was not recorded",
}


def study_headline(study: StudyAnalysis) -> Headline:
    """The stiffness to render whoever holds the device, or why there is none."""
    limit = study.limit
    if limit is None:
        return Headline(UNTRUSTED, "There is no limit: no recording could be used.", ())
    parts = [(one, headline(one.result)) for one in study.recordings if one.result is not None]
    doubtful = [one.name for one, head in parts if head.status == UNTRUSTED]
    if doubtful:
        sentence = (
            f"Do not ship a stiffness from this study: {len(doubtful)} of its "
            f"{len(study.recordings)} recordings "
            f"{'supports' if len(doubtful) == 1 else 'support'} no recommendation "
            f"({', '.join(doubtful)})."
        )
        why = "Their own pages say why. What follows is for comparison only."
        return Headline(UNTRUSTED, sentence, (why,))
    risk = next((r for r in HEADLINE_RISKS if limit.safe(r) is not None), None)
    if risk is None:
        few = "the draws are too few to state a risk of 5 %"
        return Headline(UNTRUSTED, f"Do not ship a stiffness from this study: {few}.", ())
    safe = limit.safe(risk)
    assert safe is not None
    if not math.isfinite(safe) or safe <= 0:
        extreme = "nothing limits the stiffness" if safe > 0 else "no stiffness is stable"
        sentence = f"Over all cases {extreme} at a risk of {percent(risk)}."
        return Headline(CAUTION, sentence, (what_binds(study),), doubts=(extreme,))
    return _recommended(study, parts, risk, safe)


def _recommended(study: StudyAnalysis, parts: _Parts, risk: float, safe: float) -> Headline:
    assert study.limit is not None
    unit = study.limit.unit
    low, high = (float(end) for end in study.limit.quantile([0.05, 0.95]))
    lower = _lower_witness(parts, safe)
    stated = rounded_down(safe if lower is None else lower[1], unit, low, high)
    if lower is None:
        sentence = (
            f"Render walls of at most {stated.with_level}: the risk that the loop is unstable "
            f"there is {percent(risk)}, {_scope(study)}."
        )
    else:
        sentence = (
            f"Stay below {stated.with_level}: the measured response of {lower[0]} itself puts the "
            f"limit lower than the models do ({quantity(safe, unit)} at {percent(risk)} risk), and "
            "the two must agree before the models' figure is used."
        )
    sentence += _unexplained(parts)
    details = [what_binds(study)]
    lever = study.device.lever_m
    if lever and unit == "N m/rad":
        tip = rounded_down(stated.value, "N/m", low, high, lever)
        details.append(
            f"At the tip, {quantity(lever, 'm')} from the axis, that is {tip.with_level}."
        )
    lacking = missing(study)
    warned = [n for n in study.notices if n.level == "warning"]
    beware = [n.text for n in warned] + _cautions(parts)
    if beware:
        details.append("Beware: " + " ".join(sentence_of(text) for text in beware))
    if lacking:
        details.append("What this study does not say: " + " ".join(lacking))
    doubts = [n.topic for n in warned] + ["recordings"] * bool(study.failed)
    doubts += [doubt for _, head in parts for doubt in head.doubts]
    status = status_of(doubts, (head.status for _, head in parts))
    known = risk if lower is None else None
    told = tuple(dict.fromkeys(doubts))
    return Headline(status, sentence, tuple(details), stated.value, known, told)


def _lower_witness(parts: _Parts, safe: float) -> tuple[str, float] | None:
    """The recording whose measured response puts the limit lowest, below what the models say."""
    found = [
        (one.name, head.stiffness)
        for one, head in parts
        if head.stiffness is not None and head.risk is None and head.stiffness < safe
    ]
    return min(found, key=lambda pair: pair[1], default=None)


def _unexplained(parts: _Parts) -> str:
    """What the large sentence says of recordings that are explained in part."""
    names = [one.name for one, _ in parts if one.result and is_unexplained(one.result)]
    if not names:
        return ""
    if len(parts) == 1:
        return " Part of its recording remains unexplained; the interval is widened for it."
    return (
        f" Of {len(names)} of its {len(parts)} recordings ({listed(names)}) a part remains "
        "unexplained; their intervals are widened for it."
    )


def _cautions(parts: _Parts) -> list[str]:
    """What the recordings' own pages warn of: in full of one, in a word or two each of several."""
    cautious = [(one, head) for one, head in parts if head.status == CAUTION]
    if not cautious:
        return []
    if len(cautious) == 1:
        only, head = cautious[0]
        assert only.analysis is not None
        texts = warned_of(only.analysis)
        return list(texts or (f"its page says caution ({', '.join(head.doubts)})",))
    named = listed([f"{one.name} ({', '.join(head.doubts)})" for one, head in cautious])
    return [
        f"{len(cautious)} recordings are to be used with caution, as their own pages say: {named}"
    ]


def _scope(study: StudyAnalysis) -> str:
    """Whom and what the limit covers."""
    groups = {case.group for case in study.cases}
    count = len({one.entry.user for one in study.recordings if one.result} - {None})
    holders = []
    if any(is_free(case.label, case.group) for case in study.cases):
        holders.append("nobody")
    if HELD in groups:
        holders.append("its one user" if count == 1 else f"one of these {count} people")
    if NEW_PERSON in groups:
        holders.append("a person not yet seen")
    last = f"{', '.join(holders[:-1])} or {holders[-1]}" if len(holders) > 1 else holders[0]
    text = f"whether {last} holds it" if len(holders) > 1 else f"with {last} holding it"
    along = {one.held for one in study.configurations}
    if not along:
        return text
    if along >= {not is_free(case.label, case.group) for case in study.cases}:
        return f"{text}, in every configuration"
    who = "somebody" if True in along else "nobody"
    return f"{text} (every configuration with {who} holding it, else those recorded)"


def what_binds(study: StudyAnalysis) -> str:
    """Who holds the device at its limit, and in which single case, with probabilities."""
    assert study.limit is not None
    shares: dict[str, float] = {}
    for found in study.limit.binding:
        who = _holder(found)
        shares[who] = shares.get(who, 0.0) + found.probability
    order = sorted(shares.items(), key=lambda item: -item[1])
    worth_naming = 0.005
    likely = [f"{who} ({percent(share)})" for who, share in order if share >= worth_naming]
    if not likely:
        return "Nothing limits it."
    text = f"What sets the limit: {', or '.join(likely)}."
    first = study.limit.binding[0]
    if first.case != order[0][0]:
        text += f" The case that does so most often: {first.case}."
    return text


def _holder(found: Binding) -> str:
    """Who holds the device in a case, in words."""
    group = FREE if is_free(found.case, found.group) else found.group
    return HOLDERS.get(group, group)
