"""The critical stiffness before and after closing the loop, beside the measurement's own."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.quantities import decibel, estimate
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.answer import level_rows
from bayeshaptic.report.numbers.estimates import own_limit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed


@dataclass(frozen=True)
class Row:
    """An interval of the limit: 5, 50 and 95 per cent."""

    label: str
    low: float
    middle: float
    high: float
    look: str


def rows(closed: Closed) -> tuple[Row, ...]:
    """The intervals that are finite, from before to after, the measurement's own below each."""
    widened = closed.verdict == "unexplained"
    after = "model with what was added" if closed.effects else "the same"
    pairs = [("model as declared", closed.base, style.OTHER)]
    pairs.append((f"{after}, widened" if widened else after, closed.analysis, style.MODEL))
    found = []
    for label, analysis, colour in pairs:
        found += _model(label, analysis, colour)
        if analysis is closed.base or closed.effects:
            found += _own(_own_label(closed, analysis), analysis)
    first, *rest = found
    own = [row for row in rest if row.look == style.DATA]
    if len(own) == 2 and (own[0].low, own[0].high) == (own[1].low, own[1].high):
        rest.remove(own[1])
    return (first, *rest)


def _own_label(closed: Closed, analysis: Analysis) -> str:
    if analysis is closed.base:
        return "measurement alone"
    worst = any(effect.family == "time-varying" for effect in closed.effects)
    return "measurement, worst part" if worst else "measurement, corrected"


def draw(closed: Closed) -> Figure:
    """One axis in dB; the numbers stand at the right."""
    figure = style.new_figure(0.75 + 0.3 * len(rows(closed)))
    draw_on(figure.subplots(), closed)
    return figure


def draw_on(axes: Axes, closed: Closed, narrow: bool = False) -> None:
    """The same on axes that are there; the numbers under the names where it is narrow."""
    shown, unit = rows(closed), closed.analysis.limit.unit
    style.panel(axes, f"dB re 1 {unit}" if narrow else f"critical stiffness, dB re 1 {unit}")
    axes.grid(False, axis="y")
    for place, row in enumerate(shown):
        middle = decibel(row.middle)
        ends = (middle - decibel(row.low), decibel(row.high) - middle)
        axes.errorbar(
            [middle],
            [place],
            xerr=[[max(end, 0.0)] for end in ends],
            fmt="s" if row.look != style.MODEL else "o",
            color=row.look,
            markerfacecolor=row.look if row.look == style.MODEL else "white",
            markersize=5,
            linewidth=2.0 if row.look != style.DATA else 1.1,
            capsize=3,
        )
    numbers = [estimate(row.middle, row.low, row.high, unit) for row in shown]
    level_rows(axes, [row.label for row in shown], numbers, narrow)


def _model(label: str, analysis: Analysis, colour: str) -> list[Row]:
    low, middle, high = (analysis.limit.quantile(p) for p in (0.05, 0.5, 0.95))
    return [Row(label, low, middle, high, colour)] if low > 0 and math.isfinite(high) else []


def _own(label: str, analysis: Analysis) -> list[Row]:
    own = own_limit(analysis)
    return [] if own is None or own[0] <= 0 else [Row(label, *own, style.DATA)]
