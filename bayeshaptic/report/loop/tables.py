"""The rows of the tables of a closed loop, as text that needs no further formatting."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.residuals.ripples import WAVES
from bayeshaptic.effects.library import effect_class
from bayeshaptic.quantities import NOTHING, estimate, minus, percent, quantity, scale
from bayeshaptic.report.loop.change_words import part
from bayeshaptic.report.loop.words import parameter_words, shown_estimates
from bayeshaptic.report.numbers.rows import ParameterRow, Rows
from bayeshaptic.report.numbers.titles import question, title_of
from bayeshaptic.report.numbers.unstated import errors as stated_errors

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.diagnosis.residuals.residual import Test
    from bayeshaptic.diagnosis.state import Accepted

_SHOWN = 8
_CHANCE = ", \N{MINUS SIGN}log10 of its chance"
# Of tests whose statistic is no number of standard deviations.
_UNITS = {
    "excess noise": ", dB",
    "quantisation": ", over the declared",
    "position_clipping": ", errors of the prediction",
    "held_samples": ", count",
    "dropped_samples": ", count",
    "wild_samples": ", count",
    "outside_force": ", over the usual errors",
    "mains_tone": _CHANCE,
    **{wave.test: _CHANCE for wave in WAVES},
}


@dataclass(frozen=True)
class EffectRows:
    """An accepted effect: its parameters, and what speaks for it.

    Attributes
    ----------
    title, family : str
    name : str
        As in ``summary.json``.
    parameters : rows of (what it is, estimate, 90 % interval)
    evidence : str
    ties : str
        What this recording cannot tell from it; empty where there is nothing.
    told_apart_by : str
    """

    title: str
    name: str
    family: str
    parameters: Rows
    evidence: str
    ties: str
    told_apart_by: str


def _ties(effect: Accepted) -> str:
    """What cannot be told from it, with probabilities where the limit is averaged over them."""
    known = {n: p for n, p in effect.probabilities.items() if n != effect.name}
    names = dict.fromkeys((*effect.ties, *(n for n, p in known.items() if p >= 0.01)))
    shown = (
        f"{title_of(name)} ({percent(known[name])})" if name in known else title_of(name)
        for name in names
    )
    return ", ".join(shown)


def found(closed: Closed) -> tuple[EffectRows, ...]:
    """Every accepted effect, in the order in which it was found."""
    return tuple(
        EffectRows(
            effect.title,
            effect.name,
            effect.family,
            _parameters(closed, effect, known["parameters"]),
            _sentence(effect.evidence),
            _ties(effect),
            _sentence(effect.told_apart_by),
        )
        for effect, known in zip(closed.effects, closed.diagnosis["effects"], strict=True)
    )


def candidates(closed: Closed) -> Rows:
    """The candidates of each round, best first: (round, effect, score, what became of it)."""
    rows: list[tuple[str, ...]] = []
    tried = closed.traced.candidates
    for number in sorted({c.round for c in tried}):
        ranked = sorted((c for c in tried if c.round == number), key=lambda c: -c.score)
        last = closed.traced.rejected if number == tried[-1].round else ()
        others = {trial.name for trial in last if trial.convincing}
        for candidate in ranked[:_SHOWN]:
            if candidate.taken_out:
                fate = "accepted, and taken out when another made it needless"
            elif candidate.accepted:
                fate = "accepted"
            elif candidate.name in others:
                fate = "predicts too, but less or with more parameters"
            else:
                fate = "does not predict" if candidate.score <= 0 else "not accepted"
            score = _score(candidate.score)
            if candidate.accepted and number == 0:
                mended = "mended" if effect_class(candidate.name).mended else "taken for noise"
                score, fate = NOTHING, f"seen in the samples, and {mended} before the first round"
            rows.append((str(number), candidate.title, score, fate))
    return tuple(rows)


def unshown(closed: Closed) -> int:
    """How many candidates the table leaves out."""
    return len(closed.traced.candidates) - len(candidates(closed))


def outcomes(closed: Closed) -> Rows:
    """(what was asked, class, found, threshold): the last two once more for after.

    After something was taken off a recording the thresholds are others than before.
    """
    later = {test.name: test for test in closed.traced.after}
    return tuple(
        (
            f"{question(test)}{_UNITS.get(test.name, '')}",
            test.family,
            *_outcome(test),
            *(_outcome(later.get(test.name)) if closed.effects else ()),
        )
        for test in closed.traced.before
    )


def raised(closed: Closed) -> bool:
    """Whether any threshold is another one after than before."""
    before = {test.name: test.threshold for test in closed.traced.before}
    return any(
        test.threshold != before.get(test.name, test.threshold) for test in closed.traced.after
    )


def error_heads(closed: Closed) -> tuple[str, ...]:
    """The columns of `errors`: which model, beside which measurement."""
    if closed.before_like_after is None:
        return "", "before", "after"
    other = "worst part" if part(closed) else "corrected"
    whole = "whole recording" if part(closed) else "as measured"
    return "", f"before, {whole}", f"before, {other}", f"after, {other}"


def errors(closed: Closed) -> Rows:
    """(what, before, after) of the error table of ``summary.json``, without what is missing.

    Where the measurement is another one after than before, (what, before, before beside that other
    one, after): the last two can be compared.
    """
    stated, unit = stated_errors(closed), closed.analysis.limit.unit
    keys = ("before", "before_like_after", "after")
    columns = [stated[key] for key in keys[:: 1 if closed.before_like_after is not None else 2]]

    def row(title: str, key: str, suffix: str, places: int | None = None) -> tuple[str, ...]:
        return (title, *(_number(e.get(key), suffix, places) for e in columns))

    def limits(e: Mapping[str, Any]) -> str:
        q = e["critical_stiffness"]
        if q is None or not all(math.isfinite(value) for value in q.values()):
            return NOTHING
        return estimate(q["q50"], q["q05"], q["q95"], unit)

    rows = (
        row("residual over the noise, all data", "weighted_rms", ""),
        row("residual over the noise, data held out", "held_out_weighted_rms", ""),
        row("gain, model minus measurement (rms)", "gain_db_rms", " dB"),
        row("phase, model minus measurement (rms)", "phase_deg_rms", "\N{DEGREE SIGN}"),
        ("critical stiffness, median (90 %)", *map(limits, columns)),
        row("median, model minus the measurement's own", "critical_stiffness_db", " dB", 2),
    )
    return tuple(row for row in rows if set(row[1:]) != {NOTHING})


def estimates(closed: Closed) -> tuple[ParameterRow, ...]:
    """Rows for the parameter table: of effects whose numbers are not in the posterior."""
    rows = []
    for effect, known in zip(closed.effects, closed.diagnosis["effects"], strict=True):
        for name in shown_estimates(effect):
            value = known["parameters"][name]
            row, said = scale(value["mean"], value["unit"]), parameter_words(name)
            sd = value["sd"]
            spread = f"{row.number(value['q05'], sd)} to {row.number(value['q95'], sd)}"
            rows.append(
                ParameterRow(
                    said.partition(",")[0],
                    said if "," in said else effect.title,
                    row.unit,
                    NOTHING,
                    row.with_error(value["mean"], sd),
                    spread if sd else NOTHING,
                    NOTHING,
                    NOTHING,
                    NOTHING,
                    "estimated beside the posterior",
                )
            )
    return tuple(rows)


def _parameters(closed: Closed, effect: Accepted, known: Mapping[str, Any]) -> Rows:
    rows = []
    for name in (*effect.parameters, *shown_estimates(effect)):
        value = known[name]
        row = scale(value["mean"], value["unit"])
        sd = value["sd"]
        title = (
            closed.model.parameter(name).title
            if name in effect.parameters
            else parameter_words(name)
        )
        middle = f"{row.with_error(value['mean'], sd)} {row.unit}".rstrip()
        ends = f"{row.number(value['q05'], sd)} to {row.number(value['q95'], sd)} {row.unit}"
        rows.append((title, middle, ends.rstrip() if sd else NOTHING))
    return tuple(rows)


def _sentence(text: str) -> str:
    return text and f"{text[0].upper()}{text[1:].rstrip('.')}."


def _outcome(test: Test | None) -> tuple[str, str]:
    if test is None:
        return NOTHING, NOTHING
    flag = ", beyond" if test.flagged else ""
    return f"{_score(test.statistic)}{flag}", _score(test.threshold)


def _score(value: float) -> str:
    """One decimal where the number is small, none where it is large."""
    if not math.isfinite(value):
        return NOTHING
    text = f"{round(value, 1) + 0.0:,.1f}" if abs(value) < 99.95 else f"{value:,.0f}"
    return minus(text)


def _number(value: float | None, suffix: str, places: int | None = None) -> str:
    """Three digits, or so many decimal places, with what stands behind them."""
    if value is None or not math.isfinite(value):
        return NOTHING
    if places is None:
        return quantity(value, "") + suffix
    return minus(f"{round(value, places) + 0.0:.{places}f}") + suffix
