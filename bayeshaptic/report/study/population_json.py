"""`population.json`: the numbers of one study, every key always there, null where missing."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.inference.population.reweighting import ALONE
from bayeshaptic.report.numbers.estimates import QUANTILES
from bayeshaptic.report.study.headline import study_headline
from bayeshaptic.report.summary import (
    crossings_of,
    decibels_of,
    plain,
    quantiles_of,
    recommendation,
    safe_of,
)
from bayeshaptic.stability.tail import quantiles
from bayeshaptic.types import Floats

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.hidden.several import Together
    from bayeshaptic.inference.population.population import Population
    from bayeshaptic.stability.cases import Case, DeviceLimit
    from bayeshaptic.stability.critical import CriticalStiffness
    from bayeshaptic.study.analysis import StudyAnalysis


def population_summary(study: StudyAnalysis) -> dict[str, Any]:
    """Everything that `population.json` holds, as plain dictionaries, lists, strings and floats.

    Parameters
    ----------
    study : StudyAnalysis

    Returns
    -------
    dict
        SI units; None for what is missing, and for numbers that are infinite or not a number.
        `recordings` is the number of recordings that could be used. A person not yet seen holds
        the device in the configuration in which most people were recorded, as on the page; the
        limits in the others are in `by_configuration`.
    """
    population = study.population
    return plain(
        {
            "device": study.device.name,
            "recordings": sum(one.error is None for one in study.recordings),
            "recommendation": recommendation(study_headline(study)),
            "users": _users(study),
            "population": None if population is None else _population(population),
            "correlation": None if population is None else population.correlation.mean(axis=0),
            "new_person": _new_person(study),
            "configurations": _configurations(study),
            "device_limit": None if study.limit is None else _device_limit(study.limit),
            "sampling": None if population is None else _sampling(population),
            "hidden_effects": [_hidden(effect) for effect in study.hidden] or None,
        }
    )


def population_json(study: StudyAnalysis) -> str:
    """`population_summary` as text; strict JSON, without NaN and infinity."""
    return json.dumps(population_summary(study), indent=2, allow_nan=False, ensure_ascii=False) + (
        "\n"
    )


def _users(study: StudyAnalysis) -> list[dict[str, Any]]:
    """Each user's K_CR over all configurations and trials."""
    found = []
    for user in study.study.users:
        own = [case for case in study.cases if case.user == user]
        if own:
            found.append({"user": user, "critical_stiffness": _together(own)})
    return found


def _population(population: Population) -> dict[str, Any]:
    return {
        name: {
            "log_mean": _quantiles(population.log_mean[:, i]),
            "log_sd": _quantiles(population.log_sd[:, i]),
        }
        for i, name in enumerate(population.parameters)
    }


def _sampling(population: Population) -> dict[str, Any] | None:
    """Whether the population's sampler has converged, and which recordings stand by themselves."""
    if population.chains is None:
        return None
    found = population.chains.diagnostics
    return {
        "converged": not population.chains.notices,
        "rhat_max": float(found.rhat.max()),
        "ess_min": found.ess,
        "not_pooled": sorted({one.user for one in population.recordings if one.how == ALONE}),
    }


def _hidden(effect: Together) -> dict[str, Any]:
    """What could hide: by each recording, and by all together (null where each is by itself)."""
    return {
        "name": effect.name,
        "prior": effect.prior,
        "probability": effect.together,
        "probability_alone": list(effect.alone),
        "strength_q95": effect.strength_q95[1],
        "unit": effect.unit,
    }


def _new_person(study: StudyAnalysis) -> dict[str, Any] | None:
    if not study.new_person:
        return None
    rows = [
        {"configuration": case.configuration, "critical_stiffness": _limit(case.limit)}
        for case in study.new_person
    ]
    several = len(rows) > 1
    return {**rows[0], "by_configuration": rows if several else None}


def _limit(limit: CriticalStiffness) -> dict[str, Any]:
    return {
        "unit": limit.unit,
        **quantiles_of(limit),
        "db": decibels_of(limit),
        "safe": safe_of(limit),
        "crossings": crossings_of(limit),
    }


def _configurations(study: StudyAnalysis) -> list[dict[str, Any]] | None:
    """Along a coordinate as predicted; at names, and where there are few numbers, as measured."""
    rows = [
        {
            "coordinate": coordinate,
            "held": along.held,
            "critical_stiffness": _quantiles(along.samples[:, number]),
        }
        for along in study.configurations
        for number, coordinate in enumerate(along.coordinates.tolist())
    ]
    done = {(row["coordinate"], row["held"]) for row in rows}
    for one in study.recordings:
        coordinate, held = one.entry.configuration, one.entry.user is not None
        if coordinate is None or (coordinate, held) in done:
            continue
        done.add((coordinate, held))
        own = [
            case
            for case in study.cases
            if case.group == ("held" if held else "free") and case.configuration == coordinate
        ]
        rows.append({"coordinate": coordinate, "held": held, "critical_stiffness": _together(own)})
    return rows or None


def _device_limit(limit: DeviceLimit) -> dict[str, Any]:
    return {
        "unit": limit.unit,
        **quantiles_of(limit),
        "safe": safe_of(limit),
        "binding": [{"case": b.case, "probability": b.probability} for b in limit.binding],
    }


def _together(cases: Sequence[Case]) -> dict[str, Any]:
    """Quantiles over several cases, each as often as the others."""
    if not cases:
        return dict.fromkeys(QUANTILES)
    count = min(len(case.limit.samples) for case in cases)
    samples = [np.sort(case.limit.samples) for case in cases]
    return _quantiles(
        np.concatenate([one[np.linspace(0, len(one) - 1, count).astype(int)] for one in samples])
    )


def _quantiles(samples: Floats) -> dict[str, Any]:
    values = quantiles(samples, list(QUANTILES.values()))
    return dict(zip(QUANTILES, values.tolist(), strict=True))
