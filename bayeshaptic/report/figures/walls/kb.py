"""The probability that a wall is stable over stiffness and damping, with the rules beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.quantities import Scale, percent, scale
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.drawing.hover import Reading, note

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.report.numbers.rules import Rules
    from bayeshaptic.stability.walls.filter_limits import FilterLimits
    from bayeshaptic.stability.walls.limit_table import LimitTable

# Stable with at least these probabilities, from the surest on.
PROBABILITIES = (0.999, 0.99, 0.95, 0.75, 0.5, 0.25, 0.05, 0.01, 0.001)
DARK, LIGHT = 0.62, 0.06


def draw(table: LimitTable, rules: Rules | None) -> Figure:
    """One panel for each way to get the velocity."""
    count = len(table.filters)
    figure = style.new_figure(3.5)
    panels = np.atleast_1d(figure.subplots(1, count, sharey=False))
    for axes, part in zip(panels, table.filters, strict=True):
        draw_on(axes, part, table, rules)
    handles, _ = panels[0].get_legend_handles_labels()
    style.shared_legend(figure, handles, "lower center", 3)
    return figure


def draw_on(axes: Axes, part: FilterLimits, table: LimitTable, rules: Rules | None = None) -> None:
    """One way to get the velocity, on axes that are there."""
    top = float(part.quantile(0.999)[np.isfinite(part.quantile(0.999))].max(initial=0.0))
    k, b = scale(top or 1.0, table.unit), scale(float(part.damping[-1]), table.damping_unit)
    damping = part.damping * b.factor
    style.panel(axes, f"damping B, {b.unit}", f"stiffness K, {k.unit}", title=part.kind.label)
    below = np.zeros_like(damping)
    shades = np.linspace(DARK, LIGHT, len(PROBABILITIES))
    for probability, shade in zip(PROBABILITIES, shades, strict=True):
        limit = np.minimum(part.quantile(1 - probability), 10 * top) * k.factor
        limit = np.maximum(limit, below)
        axes.fill_between(damping, below, limit, color=style.MODEL, alpha=shade, linewidth=0)
        below = limit
    for number, risk in enumerate(table.risks):
        boundary = part.boundary(risk)
        if boundary is not None:
            reached = slice(0, np.count_nonzero(boundary.stiffness > 0) + 1)
            axes.plot(
                damping[reached],
                boundary.stiffness[reached] * k.factor,
                color=style.DATA,
                linewidth=1.1,
                linestyle=style.DASHES[number],
                label=f"{percent(risk)} risk of instability",
            )
    _note(axes, part, table, b, k)
    axes.set_xlim(0, 1.04 * damping[-1] or 1.0)
    axes.set_ylim(0, 1.12 * top * k.factor or 1.0)
    if rules is not None:
        _rules(axes, rules, part.damping[-1], b.factor, k.factor)


def _note(axes: Axes, part: FilterLimits, table: LimitTable, b: Scale, k: Scale) -> None:
    """The boundaries that the draws can state, and those of larger risks between them."""
    known = {risk: part.boundary(risk) for risk in table.risks}
    stated = {risk: one.stiffness * k.factor for risk, one in known.items() if one is not None}
    rows = {
        f"{percent(risk)} risk of instability at K": (curve, k.unit)
        for risk, curve in stated.items()
    }
    middle = part.quantile(0.5) * k.factor
    rows["median limit K"] = (middle, k.unit)
    others = [1 - p for p in PROBABILITIES if 1 - p > max(table.risks) * 1.01]
    every = {**stated, **{risk: part.quantile(risk) * k.factor for risk in others}}
    risks = sorted(every)
    boundaries = np.array([every[risk] for risk in risks])
    note(axes, Reading("B", b.unit, part.damping * b.factor, rows, risks, boundaries))


def _rules(axes: Axes, rules: Rules, last: float, b: float, k: float) -> None:
    """The rules of thumb; each is drawn as far as the panel reaches."""
    damping: NDArray[Any] = np.linspace(0.0, last, 200)
    axes.plot(
        damping * b,
        rules.rigid(damping) * k,
        color=style.OTHER,
        linewidth=1.3,
        linestyle="--",
        label="(b + B)/(T/2 + td)",
    )
    passive = damping <= rules.damping
    ends = np.r_[damping[passive], rules.damping]
    axes.plot(
        ends * b,
        rules.passive(ends) * k,
        color=style.CYCLE[2],
        linewidth=1.3,
        linestyle="-.",
        label="passive: b > K T/2 + |B|",
    )
    quantised = rules.quantised
    if quantised is not None:
        # On the edge where it lies above: a mark outside would take the page from the axes.
        top = axes.get_ylim()[1]
        above = quantised * k > top
        axes.plot(
            [0.0],
            [min(quantised * k, top)],
            "^" if above else ">",
            color=style.CYCLE[3],
            markersize=7,
            clip_on=False,
            zorder=6,
            label="passive with friction and encoder" + (" (above)" if above else ""),
        )
