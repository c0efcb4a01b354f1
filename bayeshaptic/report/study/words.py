"""What a study says, in sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.quantities import NINETY, decibel, estimate, percent, pure, rounded_down
from bayeshaptic.report.listed import listed
from bayeshaptic.report.numbers.bands import band_of
from bayeshaptic.report.numbers.cases import held_cases, is_free
from bayeshaptic.report.numbers.hidden import amount
from bayeshaptic.study.recorded_cases import place_of

if TYPE_CHECKING:
    from bayeshaptic.stability.cases import Case
    from bayeshaptic.study.analysis import StudyAnalysis

_CONFIGURATION = ", configuration "


def hands(study: StudyAnalysis) -> str:
    """Free or held: which is worse, and by how much."""
    free = [case for case in study.cases if is_free(case.label, case.group)]
    held = [case for case in study.cases if not is_free(case.label, case.group)]
    if not free or not held:
        return ""
    alone, in_hand = (_median_db(cases) for cases in (free, held))
    step = in_hand - alone
    both = f"the median limit is {alone:.1f} dB without one and {in_hand:.1f} dB held"
    if max(len(free), len(held)) > 1:
        both += ", each in its worst case"
    as_bad_db = 1.0
    if abs(step) < as_bad_db:
        return f"A hand makes little difference: {both}."
    if step > 0:
        return (
            f"A hand helps: {both}. A wall that is to be safe when the user lets go must be "
            f"{step:.1f} dB softer."
        )
    return f"A hand makes it worse: {both}."


def people(study: StudyAnalysis) -> tuple[str, ...]:
    """How much people move the limit."""
    if not study.new_person:
        return ()
    case = study.new_person[0]
    where = f" (in configuration {_place(case)})" if len(study.new_person) > 1 else ""
    spread = spread_db(case)
    middle, low, high = case.limit.quantile([0.5, 0.05, 0.95])
    seen = estimate(middle, low, high, case.limit.unit)
    hardly_db = 0.15  # a spread of K_CR between people that nobody needs to care about
    if spread < hardly_db:
        first = (
            "People hardly move the critical stiffness of this device: for a person not yet seen"
            f"{where} it is {seen}, with a spread of {pure(spread, 2)} dB (sd). "
            + _rare_people(case, hardly_db)
        )
    elif not math.isfinite(spread):
        first = f"For a person not yet seen{where} the critical stiffness is {seen}."
    else:
        little_db = 0.5
        size = "a little, " if spread < little_db else ""
        first = (
            f"People move the critical stiffness of this device {size}by {pure(spread, 2)} dB "
            f"(sd): for a person not yet seen{where} it is {seen}."
        )
    branches = [c for c in case.limit.crossings if c.probability >= 0.01]
    found = [first]
    if len(branches) > 1:
        named = listed([f"{c.label} ({percent(c.probability)})" for c in branches])
        found.append(f"What limits it differs from person to person: {named}.")
    elsewhere = _elsewhere(study)
    if elsewhere:
        found.append(elsewhere)
    apart = _between(study)
    if apart:
        found.append(apart)
    return tuple(found)


def _rare_people(case: Case, sd_db: float) -> str:
    """Whether that holds of one person in a thousand, too: few users do not rule such a one out."""
    one_in_1000 = case.limit.safe(0.001)
    normal = 3.09  # standard deviations below the middle that one in a thousand is
    far_db = normal * sd_db
    if one_in_1000 is None:
        return "Of one person in a thousand nothing is known."
    if decibel(case.limit.quantile(0.5)) - decibel(one_in_1000) < far_db:
        return "Who holds it does not matter for the limit. More people would not narrow it."
    told = rounded_down(one_in_1000, case.limit.unit, *case.limit.quantile([0.05, 0.95]))
    return (
        f"That does not hold of everybody: of one person in a thousand it is below {told.text}, "
        "as far as these people say; more people may rule that out."
    )


def _elsewhere(study: StudyAnalysis) -> str:
    """A new person in the other configurations."""
    first, *others = study.new_person
    if not others:
        return ""
    parts = []
    for case in others:
        low, middle, high = (decibel(case.limit.quantile(p)) for p in (0.05, 0.5, 0.95))
        parts.append(f"{middle:.1f} dB ({low:.1f} to {high:.1f}) in configuration {_place(case)}")
    return (
        f"Most people were recorded in configuration {_place(first)}, and this is the limit there. "
        f"Elsewhere it is {listed(parts)}. The limit of the device counts all of them."
    )


def _between(study: StudyAnalysis) -> str:
    """The lowest and the highest of the people that were seen in one configuration."""
    place = study.new_person[0].configuration
    seen = [case for case in held_cases(study) if case.configuration == place]
    if len(seen) < 2:
        return ""
    order = sorted(seen, key=lambda case: case.limit.quantile(0.5))
    (low, least), (high, most) = (
        (decibel(case.limit.quantile(0.5)), case.user) for case in (order[0], order[-1])
    )
    blur = float(np.median([spread_db(case) for case in seen]))
    same = (
        " That is no more than one recording leaves open: it cannot tell these people apart."
        if high - low < 2 * blur
        else ""
    )
    return (
        f"Of those who were recorded{'' if place is None else ' there'}, {least} has the lowest "
        f"limit ({low:.2f} dB) and {most} the highest ({high:.2f} dB).{same}"
    )


def _place(case: Case) -> str:
    """The configuration of a case; empty without one."""
    return place_of(case.configuration).removeprefix(_CONFIGURATION)


def spread_db(case: Case) -> float:
    """Standard deviation of a limit in dB, from its 90 % interval."""
    low, high = (decibel(case.limit.quantile(p)) for p in (0.05, 0.95))
    return (high - low) / NINETY if math.isfinite(low) and math.isfinite(high) else math.inf


def hidden(study: StudyAnalysis) -> str:
    """What the recordings know together of effects too small to be seen."""
    shared = [one for one in study.hidden if one.together is not None]
    text = (
        "Every limit on this page allows for effects that no recording shows. What belongs to the "
        "device has one size in all of its recordings. Together they rule out what one cannot"
    )
    if not shared:
        return f"{text}; here every recording stands by itself."
    first = max(shared, key=lambda one: one.together or 0.0)
    assert first.together is not None
    return (
        f"{text}. The most probable is {first.title}: {percent(first.together)} after all of them "
        f"({percent(max(first.alone))} after the one that says most for it), no larger than "
        f"{amount(first.strength_q95[1], first.unit)}."
    )


def missing(study: StudyAnalysis) -> tuple[str, ...]:
    """What cannot be said of this device, because it was not recorded."""
    entries = [one.entry for one in study.recordings if one.result is not None]
    users = {entry.user for entry in entries if entry.user is not None}
    places = {entry.configuration for entry in entries if entry.configuration is not None}
    found = []
    if not users:
        found.append(
            "Nobody holds the device in any recording. How people change the limit, for better or "
            "worse, is unknown."
        )
    elif len(users) == 1:
        found.append("There is one user only: how much people differ is the prior's guess.")
    if entries and all(entry.user is not None for entry in entries):
        found.append(
            "There is no recording without a user: when the user lets go, the limit may be far "
            "lower."
        )
    if len(places) < 2:
        found.append("There is one configuration only: in others the limit may be different.")
    return tuple(found)


def _median_db(cases: list[Case]) -> float:
    return min(decibel(case.limit.quantile(0.5)) for case in cases)


def configurations(study: StudyAnalysis) -> tuple[str, ...]:
    """Where along the coordinate the limit is lowest, free and held."""
    found = []
    between_db = 0.1  # beyond the ends of a range, worth a word
    for one in study.configurations:
        band = band_of(one)
        who = "Held" if one.held else "With nobody holding it"
        first, *_, last = (decibel(middle) for middle in band.middle)
        low, high = decibel(band.middle.min()), decibel(band.middle.max())
        text = (
            f"{who}, the median limit goes from {first:.1f} dB in configuration "
            f"{pure(band.coordinates[0])} to {last:.1f} dB in {pure(band.coordinates[-1])}"
        )
        if min(first, last) - low > between_db or high - max(first, last) > between_db:
            text += f" (between {low:.1f} and {high:.1f} dB over all of them)"
        sure = float(one.worst_probability.max())
        found.append(
            f"{text}. The lowest is most probably near {pure(one.worst_coordinate)} (probability "
            f"{percent(sure)})."
        )
    return tuple(found)
