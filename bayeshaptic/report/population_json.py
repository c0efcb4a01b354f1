"""`population.json`: what the recordings of a study say together, as plain numbers."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.report.limits import RISKS, decibel
from bayeshaptic.report.study_bands import band_of
from bayeshaptic.report.summary import QUANTILES, plain

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.study_analysis import StudyAnalysis
    from bayeshaptic.inference.population import Population
    from bayeshaptic.stability.cases import Case, DeviceLimit

_LEVELS = tuple(QUANTILES.values())


def population_summary(study: StudyAnalysis) -> dict[str, Any]:
    """Everything that `population.json` holds, as plain dictionaries, lists, strings and floats.

    Parameters
    ----------
    study : StudyAnalysis

    Returns
    -------
    dict
        SI units; None for what is missing, and for numbers that are infinite or not a number.
    """
    found = study.population
    return plain(
        {
            "device": study.device.name,
            "recordings": [_recording(one) for one in study.recordings],
            "users": [
                {
                    "user": case.label.removeprefix("user "),
                    "critical_stiffness": _quantiles(case.limit.quantile(_LEVELS)),
                }
                for case in study.users
            ],
            "population": None if found is None else _population(found),
            "correlation": None if found is None else np.median(found.correlation, axis=0),
            "new_person": _new_person(study.new_person[0]) if study.new_person else None,
            "configurations": _configurations(study) or None,
            "device_limit": None if study.limit is None else _device_limit(study.limit),
        }
    )


def population_json(study: StudyAnalysis) -> str:
    """`population_summary` of `study` as text; strict JSON, without NaN and infinity."""
    found = population_summary(study)
    return json.dumps(found, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _recording(one: Any) -> dict[str, Any]:
    return {
        "name": one.name,
        "user": one.entry.user,
        "configuration": one.entry.configuration,
        "error": one.error,
        "critical_stiffness": None
        if one.analysis is None
        else _quantiles(one.analysis.limit.quantile(_LEVELS)),
    }


def _population(found: Population) -> dict[str, Any]:
    return {
        name: {
            "log_mean": _quantiles(np.quantile(found.log_mean[:, number], _LEVELS)),
            "log_sd": _quantiles(np.quantile(found.log_sd[:, number], _LEVELS)),
        }
        for number, name in enumerate(found.parameters)
    }


def _new_person(case: Case) -> dict[str, Any]:
    limit = case.limit
    values = limit.quantile(_LEVELS)
    return {
        "critical_stiffness": {
            "unit": limit.unit,
            **_quantiles(values),
            "db": _quantiles([decibel(value) for value in values]),
            "safe": {f"{risk:g}": limit.safe(risk) for risk in RISKS},
            "crossings": [
                {"label": c.label, "frequency_hz": c.frequency_hz, "probability": c.probability}
                for c in limit.crossings
            ],
        }
    }


def _configurations(study: StudyAnalysis) -> list[dict[str, Any]]:
    return [
        {"coordinate": coordinate, "held": one.held, "critical_stiffness": _quantiles(row)}
        for one in study.configurations
        for coordinate, row in band_of(one).rows()
    ]


def _device_limit(limit: DeviceLimit) -> dict[str, Any]:
    return {
        "unit": limit.unit,
        **_quantiles(limit.quantile(_LEVELS)),
        "safe": {f"{risk:g}": limit.safe(risk) for risk in RISKS},
        "binding": [
            {"case": found.case, "probability": found.probability} for found in limit.binding
        ],
    }


def _quantiles(values: Any) -> dict[str, Any]:
    return dict(zip(QUANTILES, values, strict=True))
