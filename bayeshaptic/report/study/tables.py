"""The rows of a study's tables, as text that needs no further formatting."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.quantities import (
    NINETY,
    NOTHING,
    Rounded,
    decibel,
    interval,
    percent,
    pure,
    quantity,
    rounded_down,
    scale,
)
from bayeshaptic.report.numbers.cases import has_draws, held_cases, raw_limits
from bayeshaptic.report.numbers.estimates import QUANTILES, RISKS
from bayeshaptic.report.numbers.hidden import amount
from bayeshaptic.report.numbers.rows import Rows
from bayeshaptic.report.numbers.titles import title_of
from bayeshaptic.report.study.words import spread_db
from bayeshaptic.stability.tail import ENOUGH_BELOW

if TYPE_CHECKING:
    from bayeshaptic.inference.population.population import Population
    from bayeshaptic.recordings.study import StudyEntry
    from bayeshaptic.stability.cases import DeviceLimit
    from bayeshaptic.stability.critical import CriticalStiffness
    from bayeshaptic.study.analysed import Analysed
    from bayeshaptic.study.analysis import StudyAnalysis

_LEVELS = tuple(QUANTILES.values())
_MOST_CASES = 8


def device(study: StudyAnalysis) -> Rows:
    """What the device is and what is known from recordings of it: (what, value).

    Of a recording that could not be used nothing is known, neither of its user nor its place.
    """
    found = study.device
    used = [one.entry for one in study.recordings if one.result is not None]
    count, places = len(study.recordings), _places(used)
    users = dict.fromkeys(entry.user for entry in used if entry.user is not None)
    rows = [
        ("Device", f"{found.name} ({found.kind})"),
        ("Study", study.study.path.name),
        ("Recordings", f"{count}" + (f", {len(used)} of them used" if len(used) < count else "")),
        ("Held by", ", ".join(users) or "nobody"),
        ("Configurations", ", ".join(places) or "one, not named"),
    ]
    if found.period_s:
        rows.append(("Sampling period", quantity(found.period_s, "s")))
    if found.delay_s is not None:
        rows.append(("Loop delay", quantity(found.delay_s, "s")))
    if found.lever_m:
        rows.append(("Lever arm", quantity(found.lever_m, "m")))
    return tuple(rows)


def _places(entries: Sequence[StudyEntry]) -> list[str]:
    places = {entry.configuration for entry in entries} - {None}
    return [str(place) for place in sorted(places, key=lambda p: (isinstance(p, str), p))]


def hidden(study: StudyAnalysis) -> Rows:
    """A row an effect that could hide: probability before, after each recording, after all."""
    return tuple(
        (
            one.title,
            percent(one.prior),
            _between(one.alone),
            NOTHING if one.together is None else percent(one.together),
            amount(one.strength_q95[0], one.unit),
            amount(one.strength_q95[1], one.unit),
            one.what,
        )
        for one in study.hidden
    )


def _between(probabilities: Sequence[float]) -> str:
    low, high = percent(min(probabilities)), percent(max(probabilities))
    return low if low == high else f"{low} to {high}"


def recordings(study: StudyAnalysis, pages: dict[str, str]) -> tuple[dict[str, Any], ...]:
    """A row a recording that could be used; `page` links its own report where there is one."""
    return tuple(
        {
            "name": one.name,
            "page": pages.get(one.name),
            "cells": _recording(one),
        }
        for one in study.recordings
        if one.analysis is not None
    )


def _recording(one: Analysed) -> tuple[str, ...]:
    analysis, entry = one.analysis, one.entry
    assert analysis is not None
    low, middle, high = analysis.limit.quantile(_LEVELS)
    parts = [str(part) for part in (entry.trial, entry.level) if part is not None]
    return (
        entry.user or "nobody",
        "" if entry.configuration is None else str(entry.configuration),
        ", ".join(parts),
        analysis.model.name,
        ", ".join(title_of(effect) for effect in one.effects) or NOTHING,
        f"{decibel(middle):.2f}",
        interval(low, high, analysis.limit.unit),
    )


def safe(study: StudyAnalysis) -> Rows:
    """The stiffness at each risk: (risk, over all cases, dB, a person not yet seen)."""
    assert study.limit is not None
    limits: list[DeviceLimit | CriticalStiffness] = [study.limit]
    limits += [case.limit for case in study.new_person[:1]]
    rows = []
    for risk in RISKS:
        found = [_stated(limit, risk) for limit in limits]
        value = 0.0 if found[0] is None else found[0].value
        level = f"{decibel(value):.2f}" if 0 < value < np.inf else NOTHING
        texts = ["not stated" if one is None else one.text for one in found]
        rows.append((percent(risk), texts[0], level, *texts[1:]))
    return tuple(rows)


def _stated(limit: DeviceLimit | CriticalStiffness, risk: float) -> Rounded | None:
    """The stiffness at a risk, rounded down; None where the draws are too few."""
    value = limit.safe(risk)
    low, high = (float(end) for end in limit.quantile([0.05, 0.95]))
    return None if value is None else rounded_down(value, limit.unit, low, high)


def unstated(study: StudyAnalysis) -> str:
    """Why there is no stiffness at some risk; empty where there is one at each."""
    assert study.limit is not None
    risk = next((risk for risk in RISKS if study.limit.safe(risk) is None), None)
    if risk is None:
        return ""
    probable = {found.case for found in study.limit.binding if found.probability > 0}
    binding = [case for case in study.cases if case.label in probable]
    case = min(binding, key=lambda one: one.limit.effective_below(risk))
    below = case.limit.effective_below(risk)
    if below >= ENOUGH_BELOW:
        return "Not stated where less than 20 effective draws of all cases together lie below."
    return (
        f"Not stated where less than {ENOUGH_BELOW} effective draws lie below: at {percent(risk)} "
        f"there are {below:.0f} for {case.label}."
    )


def binding(study: StudyAnalysis) -> Rows:
    """Every case: (case, median in dB, 90 % interval, probability that it binds)."""
    assert study.limit is not None
    cases = {case.label: case for case in study.cases}
    rows = []
    for found in study.limit.binding[:_MOST_CASES]:
        limit = cases[found.case].limit
        low, middle, high = limit.quantile(_LEVELS)
        rows.append(
            (
                found.case,
                f"{decibel(middle):.2f}",
                interval(low, high, limit.unit),
                percent(found.probability),
            )
        )
    return tuple(rows)


def unshown_cases(study: StudyAnalysis) -> int:
    """How many cases the table leaves out."""
    assert study.limit is not None
    return max(len(study.limit.binding) - _MOST_CASES, 0)


def users(study: StudyAnalysis) -> Rows:
    """Every user: (user, own recording alone in dB, given all people in dB, sd of each).

    Of one who is not in the population, others say nothing.
    """
    alone = raw_limits(study)
    rows = []
    for case in held_cases(study):
        inside = case in study.users
        own = alone.get(case.label, ()) if inside else (case.limit,)
        why = "too few draws to say" if inside else "not in the population"
        given: tuple[str, ...] = (why, NOTHING, NOTHING, NOTHING)
        if inside and has_draws(case):
            given = (
                *(f"{decibel(case.limit.quantile(p)):.2f}" for p in (0.5, 0.05, 0.95)),
                pure(spread_db(case), 2),
            )
        middles = ", ".join(f"{decibel(one.quantile(0.5)):.2f}" for one in own)
        rows.append((case.label.removeprefix("user "), middles or NOTHING, *given))
    return tuple(rows)


def population(found: Population) -> Rows:
    """Every hand parameter: (name, what it is, typical person, 90 %, spread between people)."""
    rows = []
    for number, name in enumerate(found.parameters):
        unit, title = found.model.unit(name), found.model.parameter(name).title
        low, middle, high = np.exp(np.quantile(found.log_mean[:, number], _LEVELS))
        row = scale((middle, high), unit)
        spread = (high - low) / NINETY
        wide = 100 * np.quantile(found.log_sd[:, number], _LEVELS)
        rows.append(
            (
                name,
                title,
                f"{row.number(middle, spread)} {row.unit}",
                f"{row.number(low, spread)} to {row.number(high, spread)}",
                f"{pure(wide[1], 2)} %",
                f"{pure(wide[0], 2)} to {pure(wide[2], 2)} %",
            )
        )
    return tuple(rows)


def correlations(found: Population) -> Rows:
    """The strongest correlations between hand parameters over people: (pair, median, 90 %)."""
    names, rows = found.parameters, []
    for i in range(len(names)):
        for j in range(i + 1, len(names)):
            low, middle, high = np.quantile(found.correlation[:, i, j], _LEVELS)
            rows.append((abs(middle), (f"{names[i]}, {names[j]}", middle, low, high)))
    strongest = sorted(rows, key=lambda row: -row[0])[:3]
    return tuple((pair, *(pure(v, 2) for v in values)) for _, (pair, *values) in strongest)


def provenance(study: StudyAnalysis) -> Rows:
    """Where this comes from: (what, value)."""
    seconds = sum(study.seconds.values())
    return (("Took", f"{seconds:.0f} s"),)
