"""`summary.json`: the numbers of one report, every key always there, null where missing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.errors import Notice, unique
from bayeshaptic.faq import entry
from bayeshaptic.provenance import provenance
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.report.headline import Headline, headline
from bayeshaptic.report.numbers.estimates import QUANTILES, RISKS, finite
from bayeshaptic.report.numbers.result import tip_limit
from bayeshaptic.report.numbers.trust import doubtful_parameters
from bayeshaptic.report.numbers.unstated import errors, unstated
from bayeshaptic.version import __version__

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.stability.cases import DeviceLimit
    from bayeshaptic.stability.critical import CriticalStiffness
    from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness
    from bayeshaptic.stability.limit_draws import LimitDraws

_ERROR = {
    "weighted_rms": None,
    "held_out_weighted_rms": None,
    "gain_db_rms": None,
    "phase_deg_rms": None,
    "critical_stiffness": dict.fromkeys(QUANTILES),
    "critical_stiffness_db": None,
}
_DIAGNOSIS = dict.fromkeys(("verdict", "residual_class", "effects", "candidates", "not_tried"))


def summary(result: Result, origin: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Everything that `summary.json` holds, as plain dictionaries, lists, strings and floats.

    Parameters
    ----------
    result : Analysis, or what closing the loop returns
        The latter has `analysis` (of the model with its effects) and the mappings `diagnosis`,
        `before` and `after` in the form of the file; without it those are null.
    origin : mapping or None
        What `provenance` gives; by default only what the result itself knows.

    Returns
    -------
    dict
        SI units; None for what is missing, and for numbers that are infinite or not a number.
    """
    analysis = result.analysis
    closed = result.closed
    diagnosis = _DIAGNOSIS | dict(closed.diagnosis if closed else {})
    error = errors(closed) if closed else dict.fromkeys(("before", "before_like_after", "after"))
    return plain(
        {
            "version": __version__,
            "recording": _recording(result.measured),
            "etfe": _etfe(analysis),
            "model": {
                "name": analysis.model.name,
                "effects": _effects(analysis, diagnosis),
                "parameters": list(analysis.model.names),
            },
            "least_squares": _least_squares(analysis),
            "posterior": _posterior(result),
            "critical_stiffness": _critical_stiffness(result),
            "recommendation": recommendation(headline(result)),
            "hidden": _hidden(analysis),
            "diagnosis": diagnosis,
            "error": {name: _error(given or {}) for name, given in error.items()},
            "notices": _notices(analysis.notices),
            "provenance": origin or provenance(seed=analysis.posterior.seed),
        }
    )


def summary_json(result: Result, origin: Mapping[str, Any] | None = None) -> str:
    """`summary` as text; strict JSON, without NaN and infinity."""
    return json.dumps(summary(result, origin), indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def plain(value: Any) -> Any:
    """`value` in the types of JSON: NumPy scalars unwrapped, NaN and infinities as None."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return finite(value)
    return value


def _notices(notices: tuple[Notice, ...]) -> list[dict[str, str]]:
    """Warnings first, each with the word of its entry in `bayeshaptic explain`."""
    return [
        {
            "level": notice.level,
            "topic": notice.topic,
            "text": notice.text,
            "explain": entry(notice.topic).word,
        }
        for notice in unique(notices)
    ]


def _error(given: Mapping[str, Any]) -> dict[str, Any]:
    """With every key, null where it is missing."""
    return _ERROR | {name: value for name, value in given.items() if value is not None}


def _effects(analysis: Analysis, diagnosis: Mapping[str, Any]) -> list[str]:
    """Names of the linear effects in the model, then of the others that were accepted."""
    linear = [effect.name for effect in analysis.model.effects]
    accepted = [effect["name"] for effect in diagnosis["effects"] or ()]
    return list(dict.fromkeys([*linear, *accepted]))


def _recording(analysis: Analysis) -> dict[str, Any]:
    recording, etfe = analysis.recording, analysis.etfe
    facts = dict.fromkeys(("file", "device", "user", "configuration"))
    facts |= {
        "period_s": etfe.period_s,
        "samples": None,
        "kind": etfe.kind,
        "excitation_rms": None,
        "feedback": None,
    }
    if analysis.device is not None:
        facts["device"] = analysis.device.name
    if recording is None:
        return facts
    return facts | {
        "file": recording.name if recording.source is None else recording.source.as_posix(),
        "device": recording.device or facts["device"],
        "user": recording.user,
        "configuration": recording.configuration,
        "samples": recording.samples,
        "excitation_rms": np.sqrt(np.mean(np.square(recording.force))),
        "feedback": has_feedback(analysis.notices)
        or analysis.etfe.through_reference
        or analysis.etfe.direct,
    }


def _etfe(analysis: Analysis) -> dict[str, Any]:
    etfe = analysis.etfe
    return {
        "lines": etfe.lines,
        "frequency_hz": list(etfe.band_hz),
        "median_relative_sd": np.median(etfe.relative_sd),
        "period_lines": etfe.period_lines,
    }


def _least_squares(analysis: Analysis) -> dict[str, Any]:
    fit = analysis.fit
    sd = fit.sd
    return {
        "parameters": {
            name: {"value": fit.theta[i], "sd": sd[i], "unit": fit.model.unit(name)}
            for i, name in enumerate(fit.model.names)
        },
        "reduced_chi_square": fit.reduced_chi_square,
    }


def _posterior(result: Result) -> dict[str, Any] | None:
    if not result.analysis.sampled:
        return None
    posterior, doubtful = result.analysis.stated, doubtful_parameters(result)
    return {
        "parameters": {
            name: {**found, "trusted": name not in doubtful}
            for name, found in posterior.summary().items()
        },
        "draws": len(posterior.draws),
        "ess_min": min(posterior.ess_bulk.min(), posterior.ess_tail.min()),
        "rhat_max": posterior.rhat.max(),
        "seconds": posterior.seconds,
    }


def _critical_stiffness(result: Result) -> dict[str, Any]:
    analysis = result.analysis
    limit = analysis.limit
    tip = tip_limit(analysis)
    reason = unstated(analysis)
    measured = {
        "etfe": _read_off(analysis.etfe_limit),
        "etfe_as_measured": _read_off(result.measured.etfe_limit),
    }
    if reason is not None:
        missing = dict.fromkeys(QUANTILES)
        return {
            "unit": limit.unit,
            **missing,
            "db": missing,
            "frequency_hz": missing,
            "tip": None,
            "crossings": [],
            **measured,
            "safe": {f"{risk:g}": None for risk in RISKS},
            "declared": {**missing, "db": missing},
            "reason": reason,
        }
    return {
        "unit": limit.unit,
        **quantiles_of(limit),
        "db": decibels_of(limit),
        "frequency_hz": _frequency(limit),
        "tip": None if tip is None else {"unit": tip.unit, **quantiles_of(tip)},
        "crossings": crossings_of(limit),
        **measured,
        "safe": safe_of(limit),
        "declared": {**quantiles_of(analysis.declared), "db": decibels_of(analysis.declared)},
        "reason": None,
    }


def _read_off(own: EtfeCriticalStiffness | None) -> dict[str, float | None]:
    """The limit of a measured response by itself."""
    return {name: None if own is None else getattr(own, name) for name in QUANTILES}


def _hidden(analysis: Analysis) -> list[dict[str, Any]] | None:
    """What could hide, an effect each; null where the limit does not allow for anything."""
    if analysis.hidden is None:
        return None
    return [
        {
            "name": effect.name,
            "title": effect.title,
            "prior": effect.prior,
            "probability": effect.probability,
            "strength_q95": effect.strength_q95,
            "unit": effect.unit,
            "shift_db": effect.shift_db[0]
            if -effect.shift_db[0] > effect.shift_db[2]
            else effect.shift_db[2],
            "shift": dict(zip(QUANTILES, effect.shift_db, strict=True)),
        }
        for effect in analysis.hidden.effects
    ]


def recommendation(head: Headline) -> dict[str, Any]:
    """What the sentence at the top of a page says, as numbers."""
    return {
        "status": head.status,
        "stiffness": head.stiffness,
        "risk": head.risk,
        "sentence": head.sentence,
    }


def quantiles_of(limit: LimitDraws) -> dict[str, Any]:
    """Quantiles of a limit by their keys."""
    return {name: limit.quantile(p) for name, p in QUANTILES.items()}


def decibels_of(limit: LimitDraws) -> dict[str, Any]:
    """The same in decibels."""
    return {name: limit.db(p) for name, p in QUANTILES.items()}


def safe_of(limit: CriticalStiffness | DeviceLimit) -> dict[str, Any]:
    """The stiffness at each risk by its key, null where the draws do not state it."""
    return {f"{risk:g}": limit.safe(risk) for risk in RISKS}


def crossings_of(limit: CriticalStiffness) -> list[dict[str, Any]]:
    """Which crossing binds, where, and with what probability."""
    return [
        {"label": c.label, "frequency_hz": c.frequency_hz, "probability": c.probability}
        for c in limit.crossings
    ]


def _frequency(limit: CriticalStiffness) -> dict[str, Any]:
    known = limit.frequency_hz[np.isfinite(limit.frequency_hz)]
    return {name: np.quantile(known, p) if len(known) else None for name, p in QUANTILES.items()}
