"""The distribution of the critical stiffness, which crossing binds, and the other witnesses."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import Scale, decibel, scale
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.histogram import BINS, risk_lines, stacked
from bayeshaptic.report.numbers.estimates import Witness, own_limit, witnesses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.analysis import Analysis

WIDEST = 4.0  # times the histogram's own width, to show the measurement's interval beside it
_NARROWEST = 5e-4  # of the stiffness, to either side: ticks further in would all read alike
LOG_BEYOND = 8.0  # a distribution wider than this factor is drawn on a logarithmic axis


def draw(result: Result) -> Figure:
    """The histogram by binding crossing, with risks, least squares and the measurement's own."""
    figure = style.new_figure(3.3)
    draw_on(figure.subplots(), result)
    return figure


def draw_on(axes: Axes, result: Result) -> None:
    """The same on axes that are there."""
    _histogram(axes, result.analysis, witnesses(result))


def _histogram(axes: Axes, analysis: Analysis, rows: tuple[Witness, ...]) -> None:
    limit = analysis.limit
    samples = limit.samples[np.isfinite(limit.samples)]
    style.panel(axes, y="probability density", grid=False)
    axes.set_yticks([])
    if not len(samples) or not np.any(samples > 0):
        axes.text(
            0.5,
            0.5,
            "no stiffness above zero is stable" if len(samples) else "stable at every stiffness",
            transform=axes.transAxes,
            ha="center",
        )
        axes.set_xticks([])
        return
    row = scale(float(np.median(samples)), limit.unit)
    low, high = (float(v) for v in np.quantile(samples[samples > 0], (0.0005, 0.9995)))
    logarithmic = high > LOG_BEYOND * low
    edges = _edges(low, high, logarithmic) * row.factor
    width = np.diff(np.log(edges) if logarithmic else edges)
    stacked(axes, limit, limit.samples * row.factor, edges, width)
    axes.set_xlim(*_reach(analysis, row, edges))
    axes.set_ylim(0, 1.08 * axes.get_ylim()[1])
    _lines(axes, analysis, rows, row)
    if logarithmic:
        style.log_scale(axes.xaxis, (1, 2, 5))
    else:
        axes.ticklabel_format(axis="x", useOffset=False)
    axes.set_xlabel(f"critical stiffness, {row.unit}", fontsize=style.FONT)
    _decibel_axis(axes, row, limit.unit)
    style.legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.4)


def _edges(low: float, high: float, logarithmic: bool) -> NDArray[Any]:
    if logarithmic:
        return np.geomspace(low / 1.1, high * 1.1, BINS + 1)
    margin = max(0.12 * (high - low), _NARROWEST * high)
    return np.linspace(max(low - margin, 0.0), high + margin, BINS + 1)


def _reach(analysis: Analysis, row: Scale, edges: NDArray[Any]) -> tuple[float, float]:
    """The histogram, and the measurement's own interval where that leaves it wide enough."""
    low, high = float(edges[0]), float(edges[-1])
    own = own_limit(analysis)
    if own is None:
        return low, high
    wide_low = min(low, own[0] * row.factor - 0.04 * (high - low))
    wide_high = max(high, own[2] * row.factor + 0.04 * (high - low))
    fits = wide_low > 0 and wide_high - wide_low < WIDEST * (high - low)
    return (wide_low, wide_high) if fits else (low, high)


def _lines(axes: Axes, analysis: Analysis, rows: tuple[Witness, ...], row: Scale) -> None:
    """Safe stiffnesses, least squares, and the measurement's own crossing."""
    low, high = axes.get_xlim()
    risk_lines(axes, analysis.limit, lambda safe: safe * row.factor, "of instability")
    own = [w.key for w in rows if w.key in ("etfe", "corrected")][-1:]
    for witness in rows:
        if witness.middle is None or not low <= witness.middle * row.factor <= high:
            continue
        if witness.key == "least_squares":
            axes.axvline(
                witness.middle * row.factor, color=style.OTHER, linewidth=1.4, label="least squares"
            )
        if witness.key in own and witness.low is not None and witness.high is not None:
            middle = witness.middle * row.factor
            reach = [[middle - witness.low * row.factor], [witness.high * row.factor - middle]]
            axes.errorbar(
                [middle],
                [0.965 * axes.get_ylim()[1]],
                xerr=reach,
                fmt="s",
                color=style.DATA,
                capsize=3,
                markersize=4,
                linewidth=1.1,
                label=f"{witness.label}, 90 %",
            )
    axes.set_xlim(low, high)


def _decibel_axis(axes: Axes, row: Scale, unit: str) -> None:
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    low, high = (decibel(v / row.factor) for v in axes.get_xlim())
    low = low if np.isfinite(low) else high - 40.0
    steps = (digit * 10.0**power for power in range(-5, 3) for digit in (1, 2, 5))
    step = next(step for step in steps if (high - low) / step <= 7)
    ticks = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    top = axes.secondary_xaxis("top")
    places = _apart(axes, 10 ** (ticks / 20) * row.factor)
    top.xaxis.set_major_locator(FixedLocator(places))
    top.xaxis.set_minor_locator(NullLocator())
    top.xaxis.set_minor_formatter(NullFormatter())
    decimals = max(-int(np.floor(np.log10(step) + 1e-9)), 0)
    top.xaxis.set_major_formatter(
        FuncFormatter(lambda value, _: f"{decibel(value / row.factor):.{decimals}f}")
    )
    top.tick_params(labelsize=style.FONT - 0.5, width=0.6, length=3)
    top.spines["top"].set_linewidth(0.6)
    top.set_xlabel(f"dB re 1 {unit}", fontsize=style.FONT)


def _apart(axes: Axes, places: NDArray[Any]) -> list[float]:
    """Those of ascending places whose numbers have room: decibels crowd at the soft end."""
    ends = np.column_stack([places, np.ones(len(places))])
    across = (axes.transScale + axes.transLimits).transform(ends)[:, 0]
    room = 0.07  # of the axis
    kept: list[int] = []
    for index in reversed(range(len(places))):
        if not kept or across[kept[-1]] - across[index] >= room:
            kept.append(index)
    return [float(places[index]) for index in reversed(kept)]
