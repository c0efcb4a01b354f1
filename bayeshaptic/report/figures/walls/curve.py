"""The probability that a wall is stable over its stiffness, without damping."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.quantities import percent, rounded_down, scale
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.drawing.hover import Reading, note
from bayeshaptic.stability.tail import quantiles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.stability.walls.limit_table import LimitTable

LOWEST_RISK = 5e-4
LOG_BEYOND = 4.0  # limits further apart than this factor are drawn on a logarithmic axis
SHOWN = 6  # cases with a curve of their own
_LONGEST = 52  # characters of a case's name: half of the page, and it stands there alone


def draw(table: LimitTable) -> Figure:
    """P(stable) on the left; P(unstable) on a logarithmic scale on the right."""
    curves = _curves(table)
    figure = style.new_figure(2.6 if len(curves) == 1 else 2.95)
    left, right = figure.subplots(1, 2)
    row = scale(float(np.median(_finite(table.samples))), table.unit)
    for number, (label, samples) in enumerate(curves):
        whole = number == 0
        look: dict[str, Any] = {
            "color": style.DATA if whole else style.CYCLE[(number - 1) % len(style.CYCLE)],
            "linestyle": "-" if whole else style.DASHES[1:][(number - 1) % 6],
            "linewidth": 1.2 if not whole else 1.8 if len(curves) == 1 else 4.0,
            "alpha": 0.35 if whole and len(curves) > 1 else 1.0,
        }
        stiffness, below = _steps(samples)
        left.plot(stiffness * row.factor, 1 - below, label=label, **look)
        right.plot(stiffness * row.factor, below, **look)
        if whole:
            rows = {"stable with": (100 * (1 - below), "%"), "risk": (100 * below, "%")}
            for axes in (left, right):
                note(axes, Reading("K", row.unit, stiffness * row.factor, rows))
    for axes, name in ((left, "probability of being stable"), (right, "risk of instability")):
        style.panel(axes, f"stiffness K, {row.unit}", name)
    if np.isfinite(table.samples).any():
        right.set_yscale("log")
    else:
        right.text(0.5, 0.5, "stable at every stiffness", ha="center", transform=right.transAxes)
    right.set_ylim(LOWEST_RISK, 1.0)
    _percentages(right)
    _marks(right, table, row.factor)
    left.set_ylim(-0.02, 1.02)
    _reach(left, right, [samples for _, samples in curves], row.factor)
    if len(curves) > 1:
        handles, _ = left.get_legend_handles_labels()
        columns = _columns(label for label, _ in curves)
        style.shared_legend(figure, handles, "lower center", columns)
    return figure


def _columns(labels: Iterable[str]) -> int:
    """How many entries of a legend stand side by side on the page's width."""
    widest = 0.45 + 0.06 * max(len(label) for label in labels)
    return min(max(int(style.WIDTH_IN / widest), 1), 4)


def _curves(table: LimitTable) -> list[tuple[str, NDArray[Any]]]:
    if len(table.cases) == 1:
        return [(style.called(table.cases[0].label), table.cases[0].limit.samples)]
    order = sorted(table.cases, key=lambda case: case.limit.quantile(0.05))
    own = [(style.called(case.label, _LONGEST), case.limit.samples) for case in order[:SHOWN]]
    return [("in every case", table.samples), *own]


def _finite(samples: NDArray[Any]) -> NDArray[Any]:
    known = samples[np.isfinite(samples)]
    return known if len(known) else np.ones(1)


def _steps(samples: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Stiffness and the share of draws below it, thinned to what a figure can show."""
    ordered = np.sort(samples)
    share = (np.arange(len(ordered)) + 0.5) / len(ordered)
    tail = np.geomspace(LOWEST_RISK, 0.02, 60)
    wanted = np.unique(np.r_[tail, np.linspace(0.02, 1.0, 200)])
    kept = np.unique(np.clip(np.searchsorted(share, wanted), 0, len(ordered) - 1))
    kept = kept[np.isfinite(ordered[kept])]
    return np.r_[0.0, ordered[kept]], np.r_[0.0, share[kept]]


def _reach(left: Axes, right: Axes, curves: list[NDArray[Any]], factor: float) -> None:
    """From where the first curve leaves the risk of 0.05 % to where the last one has ended."""
    from matplotlib.ticker import MaxNLocator

    ends = np.array([np.quantile(_finite(samples), (0.0005, 0.5, 0.9995)) for samples in curves])
    low, high = ends[:, 0].min() * factor, ends[0, 2] * factor
    for axes in (left, right):
        axes.xaxis.set_major_locator(MaxNLocator(5))
    narrowest = 5e-4  # of the stiffness, to either side: ticks further in would all read alike
    margin = max(0.06 * (high - low), narrowest * high) or 1.0
    middle, high = max(ends[0, 1] * factor, low), ends[:, 2].max() * factor
    for axes, end in ((right, middle), (left, high)):
        if low > 0 and end > LOG_BEYOND * low:
            style.log_scale(axes.xaxis, (1, 2, 5))
            axes.set_xlim(low / 1.1, end * 1.1)
        else:
            axes.ticklabel_format(axis="x", useOffset=False)
            axes.set_xlim(max(low - margin, 0.0), end + margin)


def _percentages(axes: Axes) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter

    axes.yaxis.set_major_locator(FixedLocator([0.001, 0.01, 0.05, 0.1, 0.5, 1.0]))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{100 * value:g} %"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _marks(axes: Axes, table: LimitTable, factor: float) -> None:
    low, high = (float(end) for end in quantiles(table.samples, (0.05, 0.95)))
    for risk, stiffness in zip(table.risks, table.stiffness, strict=True):
        if stiffness is not None and np.isfinite(stiffness):
            axes.plot(
                [stiffness * factor],
                [risk],
                "o",
                color=style.OTHER,
                markersize=4.5,
                zorder=6,
                label=f"{rounded_down(stiffness, table.unit, low, high).text} at {percent(risk)}",
            )
    if axes.get_legend_handles_labels()[0]:
        # Where the risk has not risen yet, or is below the curve: that corner is free.
        style.legend(axes, loc="lower right", handlelength=1.0)
