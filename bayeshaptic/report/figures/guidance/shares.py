"""Where the doubt about the critical stiffness comes from, and what moves it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.stability.guidance.elasticities import Elasticities
    from bayeshaptic.stability.guidance.guidance import Guidance
    from bayeshaptic.stability.guidance.shares import VarianceShares

SHOWN = 8
NAMED = 4  # parameters of a group that its label names
LEAST = 0.05  # probability of a crossing that is shown


def draw(guidance: Guidance) -> Figure:
    """Shares of the variance on the left, elasticities at the binding crossings on the right."""
    found = [e for e in guidance.elasticities if e.crossing.probability >= LEAST]
    names = _moving(found)
    rows = max(min(len(guidance.shares.shares), SHOWN) + 1, len(names), 3)
    figure = style.new_figure(1.35 + 0.24 * rows)
    left, right = figure.subplots(1, 2)
    _shares(left, guidance.shares)
    _elasticities(right, found, names)
    if len(found) > 1:
        handles, _ = right.get_legend_handles_labels()
        style.shared_legend(figure, handles, "lower right", 2)
    return figure


def labels(shares: VarianceShares) -> list[tuple[str, float]]:
    """Every bar: its name and share, what is beyond the parameters last."""
    rows = [(_together(share.names), share.share) for share in shares.shares[:SHOWN]]
    if shares.beyond > 0.005:
        rows.append(("doubt about the model", shares.beyond))
    return rows


def _together(names: tuple[str, ...]) -> str:
    """The names of a group, as many as a label holds; the sentence has them all."""
    shown = [style.short(name) for name in names[: NAMED if len(names) > NAMED + 1 else None]]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def _shares(axes: Axes, shares: VarianceShares) -> None:
    style.panel(axes, "share of the variance of ln K, %", title="where the uncertainty comes from")
    rows = labels(shares)
    axes.grid(False, axis="y")
    axes.barh(
        range(len(rows)),
        [100 * share for _, share in rows],
        color=style.MODEL,
        alpha=0.75,
        height=0.6,
    )
    for place, (_, share) in enumerate(rows):
        axes.text(
            100 * share + 1.5, place, f"{100 * share:.0f}", va="center", fontsize=style.SMALL + 0.5
        )
    style.rows(axes, [name for name, _ in rows])
    axes.set_xlim(0, max([100 * share for _, share in rows], default=0.0) * 1.15 + 5)


def _moving(found: list[Elasticities]) -> list[str]:
    """The names of the parameters that move the limit most, at any of the crossings."""
    if not found:
        return []
    size = np.max([np.abs(np.median(e.values, axis=0)) for e in found], axis=0)
    order = np.argsort(-size)[:SHOWN]
    return [found[0].names[i] for i in order if size[i] > 0.005]


def _elasticities(axes: Axes, found: list[Elasticities], names: list[str]) -> None:
    style.panel(axes, "change of K by 1 % more of it, %", title="what moves the limit")
    axes.grid(False, axis="y")
    axes.axvline(0, color=style.DATA, linewidth=0.7)
    count = len(found)
    for number, one in enumerate(found):
        middle = one.median
        ends = [one.interval(name) for name in names]
        places = np.arange(len(names)) + (number - 0.5 * (count - 1)) * 0.6 / max(count, 1)
        values = np.array([middle[name] for name in names])
        axes.barh(
            places,
            values,
            height=0.6 / max(count, 1),
            color=style.CYCLE[number],
            hatch=style.HATCHES[number],
            alpha=0.75,
            label=one.crossing.label,
        )
        reach = np.abs(np.array(ends).reshape(-1, 2).T - values)
        axes.errorbar(values, places, xerr=reach, fmt="none", color=style.DATA, linewidth=0.9)
    style.rows(axes, [style.short(name) for name in names])
