"""The one large sentence of a study: the stiffness to render whoever holds the device."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING

from bayeshaptic.quantities import percent, quantity, rounded_down
from bayeshaptic.report.headline import Headline, headline
from bayeshaptic.report.numbers.cases import is_free
from bayeshaptic.report.study.words import missing
from bayeshaptic.stability.cases import CONFIGURATION, FREE, HELD, NEW_PERSON

if TYPE_CHECKING:
    from bayeshaptic.stability.cases import Binding
    from bayeshaptic.study.analysed import Analysed
    from bayeshaptic.study.analysis import StudyAnalysis

RISKS = (0.01, 0.05)
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
        return Headline("untrusted", "There is no limit: no recording could be used.", ())
    doubtful = untrusted(study.recordings)
    if doubtful:
        names = ", ".join(one.name for one in doubtful)
        sentence = (
            f"Do not ship a stiffness from this study: {len(doubtful)} of its "
            f"{len(study.recordings)} recordings "
            f"{'supports' if len(doubtful) == 1 else 'support'} no recommendation ({names})."
        )
        why = "Their own pages say why. What follows is for comparison only."
        return Headline("untrusted", sentence, (why,))
    risk = next((r for r in RISKS if limit.safe(r) is not None), None)
    if risk is None:
        few = "the draws are too few to state a risk of 5 %"
        return Headline("untrusted", f"Do not ship a stiffness from this study: {few}.", ())
    safe = limit.safe(risk)
    assert safe is not None
    if not math.isfinite(safe) or safe <= 0:
        extreme = "nothing limits the stiffness" if safe > 0 else "no stiffness is stable"
        return Headline("caution", f"Over all cases {extreme}.", ())
    return _recommended(study, risk, safe)


def _recommended(study: StudyAnalysis, risk: float, safe: float) -> Headline:
    assert study.limit is not None
    low, high = (float(end) for end in study.limit.quantile([0.05, 0.95]))
    stated = rounded_down(safe, study.limit.unit, low, high)
    sentence = (
        f"Render walls of at most {stated.with_level}: the risk that the loop is unstable there is "
        f"{percent(risk)}, {_scope(study)}."
    )
    details = [what_binds(study)]
    lever = study.device.lever_m
    if lever and study.limit.unit == "N m/rad":
        tip = rounded_down(stated.value, "N/m", low, high, lever)
        details.append(
            f"At the tip, {quantity(lever, 'm')} from the axis, that is {tip.with_level}."
        )
    lacking = missing(study)
    warned = [n.text for n in study.notices if n.level == "warning"]
    if warned:
        details.append("Beware: " + " ".join(sentence_of(text) for text in warned))
    if lacking:
        details.append("What this study does not say: " + " ".join(lacking))
    status = "caution" if warned or study.failed else "safe"
    return Headline(status, sentence, tuple(details), stated.value, risk)


def untrusted(recordings: Iterable[Analysed]) -> tuple[Analysed, ...]:
    """The recordings whose own reports recommend no stiffness."""
    return tuple(
        one
        for one in recordings
        if one.result is not None and headline(one.result).status == "untrusted"
    )


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
    return f"{text}, in every configuration" if CONFIGURATION in groups else text


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


def sentence_of(text: str) -> str:
    text = text.strip()
    return text if text.endswith((".", "!", "?")) else text + "."
