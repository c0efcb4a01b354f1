"""The answer at a glance: every estimate of the limit on one axis, and the stiffness to render."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import decibel, estimate, quantity, spread_of
from bayeshaptic.report.figures import style
from bayeshaptic.report.headline import headline
from bayeshaptic.report.numbers.estimates import Witness, witnesses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Inches of a phone's screen, on which a figure of the page's width would be scrolled.
_PHONE_IN = 3.75


def draw(result: Result) -> Figure:
    """A row an estimate, in dB; the numbers stand at the right."""
    rows = shown(result)
    figure = style.new_figure(0.75 + 0.27 * max(len(rows), 1))
    draw_on(style.panel(figure.subplots()), result)
    return figure


def draw_narrow(result: Result) -> Figure:
    """The same for a phone: the numbers stand under the names."""
    rows = shown(result)
    figure = style.new_figure(0.7 + 0.36 * max(len(rows), 1), _PHONE_IN)
    draw_on(style.panel(figure.subplots()), result, narrow=True)
    return figure


def shown(result: Result) -> tuple[Witness, ...]:
    """The estimates that have a place on the axis."""
    return tuple(w for w in witnesses(result) if w.middle is not None and w.middle > 0)


def draw_on(axes: Axes, result: Result, narrow: bool = False) -> None:
    """The same on axes that are there."""
    rows, unit = shown(result), result.analysis.limit.unit
    style.panel(axes, f"dB re 1 {unit}" if narrow else f"critical stiffness, dB re 1 {unit}")
    axes.grid(False, axis="y")
    stiffness = headline(result).stiffness
    if stiffness is not None:
        axes.axvline(decibel(stiffness), color=style.CYCLE[2], linewidth=1.6, zorder=1)
    for place, witness in enumerate(rows):
        assert witness.middle is not None
        middle, reach = decibel(witness.middle), [[0.0], [0.0]]
        if witness.low is not None and witness.high is not None and witness.low > 0:
            ends = middle - decibel(witness.low), decibel(witness.high) - middle
            reach = [[max(end, 0.0)] for end in ends]
        ours = witness.key == "posterior"
        axes.errorbar(
            [middle],
            [place],
            xerr=reach,
            fmt="o" if ours else "s",
            color=style.MODEL if ours else style.DATA,
            markerfacecolor=style.MODEL if ours else "white",
            markersize=5.5 if ours else 4,
            linewidth=3.0 if ours else 1.2,
            capsize=3,
        )
    spread = spread_of(rows[0].low or 0.0, rows[0].high or 0.0) if rows else None
    names, numbers = [w.label for w in rows], [_number(w, unit, spread) for w in rows]
    level_rows(axes, names, numbers, narrow)


def level_rows(axes: Axes, names: Sequence[str], numbers: Sequence[str], narrow: bool) -> None:
    """Names of rows of levels in dB at the left, their numbers at the right or, narrow, under them.

    The axis is at least 1 dB long.
    """
    if narrow:
        names = [f"{name}\n{number}" for name, number in zip(names, numbers, strict=True)]
    style.rows(axes, names, () if narrow else numbers)
    low, high = axes.get_xlim()
    narrowest_db = 1.0
    if high - low < narrowest_db:
        centre = 0.5 * (low + high)
        axes.set_xlim(centre - narrowest_db / 2, centre + narrowest_db / 2)
    axes.ticklabel_format(axis="x", useOffset=False)


def _number(witness: Witness, unit: str, spread: float | None) -> str:
    """With the digits of the table of the same estimates."""
    if witness.middle is None or witness.low is None or witness.high is None:
        return quantity(witness.middle, unit, spread)
    return estimate(witness.middle, witness.low, witness.high, unit)
