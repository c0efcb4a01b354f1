"""The posterior of each parameter, its prior over it, and least squares beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.rows import scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.analysis import Analysis

COLUMNS = 4
BINS = 36


def draw(result: Result) -> Figure:
    """A small panel a parameter, each with its own unit; densities without an axis."""
    analysis = result.analysis
    model = analysis.model
    columns = min(COLUMNS, max(model.size, 3))
    rows = -(-model.size // columns)
    figure = style.new_figure(0.35 + 1.45 * rows)
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for index, axes in enumerate(panels):
        if index < model.size:
            _marginal(axes, analysis, index)
        else:
            axes.axis("off")
    handles, _ = panels[0].get_legend_handles_labels()
    style.shared_legend(figure, handles, "upper center", 3)
    return figure


def draw_on(axes: Axes, result: Result, name: str) -> None:
    """One parameter on axes that are there."""
    _marginal(axes, result.analysis, result.analysis.model.names.index(name))


def _marginal(axes: Axes, analysis: Analysis, index: int) -> None:
    model, fit = analysis.model, analysis.fit
    name = model.names[index]
    draws = analysis.stated.draws[:, index]
    row = scale_of(draws, model.unit(name))
    low, high = _range(draws, float(fit.theta[index]), model.prior(name).support)
    density, edges = np.histogram(draws, BINS, (low, high), density=True)
    density, edges = density / row.factor, edges * row.factor
    axes.stairs(density, edges, fill=True, color=style.MODEL, alpha=0.45, label="posterior")
    axes.stairs(density, edges, color=style.MODEL, linewidth=0.8)
    x = 0.5 * (edges[1:] + edges[:-1]) / row.factor  # as coarse: a prior may be steep at zero
    prior = np.exp(model.prior(name).log_density(x)) / row.factor
    axes.plot(x * row.factor, prior, "--", color=style.PRIOR, linewidth=1.1, label="prior")
    axes.axvline(
        fit.theta[index] * row.factor,
        color=style.OTHER,
        linewidth=1.2,
        linestyle="-.",
        label="least squares",
    )
    style.panel(axes, grid=False, title=style.named(name, row.unit), size=style.FONT - 0.5)
    axes.set_xlim(low * row.factor, high * row.factor)
    axes.set_ylim(0, 1.12 * max(float(density.max()), float(prior[np.isfinite(prior)].max())))
    axes.set_yticks([])
    axes.spines["left"].set_visible(False)
    _ticks(axes)
    if analysis.stated.prior_dominated.get(name):
        axes.set_xlabel("the prior decides this one", fontsize=style.SMALL, style="italic")


def _range(
    draws: NDArray[Any], least_squares: float, support: tuple[float, float]
) -> tuple[float, float]:
    """Where the posterior is, and least squares too where that is not far away."""
    low, high = (float(v) for v in np.quantile(draws, (0.001, 0.999)))
    width = (high - low) or abs(high) or 1.0
    if low - 0.6 * width < least_squares < high + 0.6 * width:
        low, high = min(low, least_squares), max(high, least_squares)
    low, high = low - 0.08 * width, high + 0.08 * width
    return max(low, support[0]), min(high, support[1])


def _ticks(axes: Axes) -> None:
    from matplotlib.ticker import FixedLocator, MaxNLocator

    low, high = axes.get_xlim()
    usual = MaxNLocator(3, steps=[1, 2, 2.5, 5, 10])
    ticks = [tick for tick in usual.tick_values(low, high) if low <= tick <= high]
    long = 6  # letters of a number that leave no room for three of them
    crowded = len(ticks) > 2 and max(len(f"{tick:.7g}") for tick in ticks) >= long
    axes.xaxis.set_major_locator(FixedLocator([ticks[0], ticks[-1]]) if crowded else usual)
    axes.ticklabel_format(axis="x", useOffset=False, style="plain")
