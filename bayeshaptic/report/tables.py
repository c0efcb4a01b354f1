"""The rows of the report's tables, as text that needs no further formatting."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import (
    NOTHING,
    decibel,
    interval,
    minus,
    percent,
    percents,
    pretty_unit,
    pure,
    quantity,
    rounded_down,
    scale,
    spread_of,
)
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.feedback import doubts, has_feedback
from bayeshaptic.report.numbers.estimates import QUANTILES, RISKS, finite, witnesses
from bayeshaptic.report.numbers.result import tip_limit
from bayeshaptic.report.numbers.rows import ParameterRow, Rows, scale_of
from bayeshaptic.report.numbers.trust import doubtful_parameters

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.models.prior import Prior
    from bayeshaptic.stability.critical import CriticalStiffness

_OUTCOMES = {
    "at a bound": "least squares stopped at its bound",
    "prior-dominated": "the data alone do not decide it",
}


def parameters(result: Result) -> tuple[ParameterRow, ...]:
    """Least squares beside the posterior, a row a parameter."""
    analysis, doubtful = result.analysis, doubtful_parameters(result)
    fit, posterior, model = analysis.fit, analysis.stated, analysis.model
    rows = []
    for i, (name, found) in enumerate(posterior.summary().items()):
        row = scale_of(posterior.draws[:, i], found["unit"])
        value, sd = float(fit.theta[i]), finite(fit.sd[i])
        low, high = (row.number(found[q], found["sd"], least=0) for q in ("q05", "q95"))
        remarks = [_OUTCOMES.get(fit.outcome.get(name, ""), "")]
        if found["prior_dominated"]:
            remarks.append("the prior decides this one")
        if name in doubtful:
            remarks.append("not to be trusted")
        rows.append(
            ParameterRow(
                name,
                model.parameter(name).title,
                row.unit,
                row.with_error(value, sd) if sd else row.number(value, found["sd"]),
                row.with_error(found["mean"], found["sd"]),
                f"{low} to {high}",
                row.number(model.reference.get(name)),
                f"{min(found['ess_bulk'], found['ess_tail']):.0f}",
                f"{found['rhat']:.3f}",
                "; ".join(text for text in remarks if text),
                _shrinkage(model.prior(name), found["q05"], found["q95"]),
            )
        )
    return tuple(rows)


def _shrinkage(prior: Prior, low: float, high: float) -> str:
    """The width of the 90 % interval over that of the prior."""
    wide = float(np.diff(prior.quantile(np.array([0.05, 0.95])))[0])
    if not (np.isfinite(wide) and wide > 0):
        return NOTHING
    share = 100 * (high - low) / wide
    if share > 100:
        return "over 100 %"
    least = 0.01
    return f"{pure(share, 2)} %" if share >= least else f"under {least} %"


def limit(analysis: Analysis) -> Rows:
    """Quantiles of the limit: (what, 5 %, median, 95 %)."""
    stiffness, tip = analysis.limit, tip_limit(analysis)
    levels = tuple(QUANTILES.values())
    rows = [("critical stiffness", *_scaled(stiffness.quantile(levels), stiffness.unit))]
    rows.append((f"in dB re 1 {stiffness.unit}", *(_db(stiffness.quantile(p)) for p in levels)))
    if analysis.hidden is not None:
        exact = _scaled(analysis.declared.quantile(levels), stiffness.unit)
        if exact != rows[0][1:]:
            rows.append(("if the model is exact", *exact))
    if tip is not None:
        rows.append(("at the tip", *_scaled(tip.quantile(levels), tip.unit)))
        rows.append((f"at the tip in dB re 1 {tip.unit}", *(_db(tip.quantile(p)) for p in levels)))
    known = stiffness.frequency_hz[np.isfinite(stiffness.frequency_hz)]
    if len(known):
        hertz = _scaled(np.quantile(known, levels), "Hz")
        rows.append(("frequency of the binding crossing", *hertz))
    return tuple(rows)


def safe(analysis: Analysis) -> Rows:
    """The stiffness at each risk: (risk, stiffness, dB), and at the tip where there is a lever.

    Rounded down, as in the sentence that leads the page.
    """
    limit, tip = analysis.limit, tip_limit(analysis)
    ends = (limit.quantile(0.05), limit.quantile(0.95))
    shown: dict[tuple[str, ...], list[float]] = {}
    for risk in RISKS:
        found = limit.safe(risk)
        if found is None:
            row = ["too few draws to say", NOTHING, NOTHING]
        else:
            stated = rounded_down(found, limit.unit, *ends)
            row = [stated.text, _db(stated.value)]
            if tip is not None and analysis.lever_m is not None:
                row.append(rounded_down(stated.value, tip.unit, *ends, analysis.lever_m).text)
        row = row[: 2 if tip is None else 3]
        shown.setdefault(tuple(row), []).append(risk)
    # Risks that are one number to the digits shown are said once.
    return tuple((percents(risks), *row) for row, risks in shown.items())


def crossings(limit: CriticalStiffness) -> Rows:
    """Which crossing binds: (label, median frequency, probability)."""
    return tuple(
        (c.label, quantity(c.frequency_hz, "Hz", digits=4), percent(c.probability))
        for c in limit.crossings
    )


def comparison(result: Result) -> Rows:
    """Every estimate of the limit: (name, 5 %, middle, 95 %, dB, difference in dB, remark)."""
    analysis, found = result.analysis, witnesses(result)
    ours = decibel(found[0].middle or 0.0)
    ours_spread = spread_of(found[0].low or 0.0, found[0].high or 0.0)
    rows = []
    for witness in found:
        middle = witness.middle
        ends = (witness.low, witness.high)
        spread = ours_spread if None in ends else spread_of(*ends)  # type: ignore[arg-type]
        numbers = _scaled([witness.low, middle, witness.high], analysis.limit.unit, spread)
        level = NOTHING if not middle else f"{decibel(middle):.2f}"
        apart = NOTHING
        if middle and np.isfinite(ours) and witness.key != "posterior":
            difference = round(decibel(middle) - ours, 2) + 0.0  # no minus before a zero
            apart = minus(f"{difference:+.2f}")
        rows.append((witness.label, *numbers, level, apart, witness.remark))
    return tuple(rows)


def measured(analysis: Analysis) -> Rows:
    """What was measured: (what, value)."""
    recording, etfe = analysis.recording, analysis.etfe
    unit = pretty_unit(etfe.force_unit)
    rows: list[tuple[str, ...]] = []
    if recording is None:
        rows.append(("Measurement", "a frequency response table, without its recording"))
    else:
        rows.append(("Recording", recording.name))
        who = "somebody" if analysis.model.held else "nobody"
        rows.append(("Held by", recording.user or f"no user named; by the model {who}"))
        for title, value in (
            ("Configuration", recording.configuration),
            ("Trial", recording.trial),
            ("Level", recording.level),
        ):
            if value is not None:
                rows.append((title, str(value)))
        rows.append(("Samples", f"{recording.samples:,} in {quantity(recording.duration_s, 's')}"))
        rms = float(np.sqrt(np.mean(np.square(recording.force))))
        rows.append(("Excitation", f"{quantity(rms, unit)} rms ({_excitation(analysis)})"))
        if recording.encoder_resolution is not None:
            count = quantity(recording.encoder_resolution, recording.position_unit)
            rows.append(("One encoder count", count))
    rate = quantity(1 / etfe.period_s, "Hz")
    rows.append(("Sampling period", f"{quantity(etfe.period_s, 's')} ({rate})"))
    rows.append(("Units", f"force in {unit}, position in {etfe.position_unit}"))
    rows.append(("Frequencies used", f"{interval(*etfe.band_hz, 'Hz')}, {etfe.lines:,} lines"))
    error = percent(float(np.median(etfe.relative_sd)))
    rows.append(("Error of the response", f"{error} of its magnitude (median sd)"))
    if analysis.device is not None:
        rows.insert(1, ("Device file", analysis.device.name))
    elif recording is not None and recording.device:
        rows.insert(1, ("Device", recording.device))
    return tuple(rows)


def _excitation(analysis: Analysis) -> str:
    if has_feedback(analysis.notices):
        return "computed from the motion"
    if analysis.etfe.through_reference:
        return "of a controller, read through what of it the motion does not make"
    if analysis.etfe.direct:
        random = ", or random" if doubts(analysis.notices) else ""
        return f"of a controller, whichever it is{random}"
    if told_too_little(analysis.notices):
        return "too little of a response"
    lines = analysis.etfe.period_lines
    return "random" if lines is None else f"periodic, {lines} excited lines"


def _scaled(
    values: Iterable[float | None], unit: str, spread: float | None = None
) -> tuple[str, ...]:
    """Numbers of one row with the same prefix, digits by their spread."""
    values = list(values)
    known = [float(v) for v in values if v is not None and np.isfinite(v)]
    row = scale(known, unit)
    if spread is None and known:
        spread = spread_of(min(known), max(known))
    return tuple(
        NOTHING if v is None else "no limit" if v == np.inf else row.quantity(v, spread)
        for v in values
    )


def _db(stiffness: float) -> str:
    level = decibel(stiffness)
    return f"{level:.2f} dB" if np.isfinite(level) else NOTHING
