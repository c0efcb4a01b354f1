"""Which parameters the data cannot tell apart: the strongest correlations, pair by pair."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import minus
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.rows import scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SHOWN = 6
POINTS = 800
LEVELS = (0.9, 0.5)


def correlation(draws: NDArray[Any]) -> NDArray[Any]:
    """Spearman's rank correlation of draws of shape (n, P), shape (P, P): no coordinate matters."""
    ranks = np.argsort(np.argsort(draws, axis=0), axis=0).astype(float)
    return np.atleast_2d(np.corrcoef(ranks, rowvar=False))


def strongest(matrix: NDArray[Any], count: int = SHOWN) -> list[int]:
    """Indices of the `count` parameters in the strongest of correlations (P, P), in order."""
    size = np.abs(np.triu(matrix, 1))
    chosen: list[int] = []
    for flat in np.argsort(-size, axis=None):
        pair = [int(i) for i in np.unravel_index(flat, size.shape)]
        new = [i for i in pair if i not in chosen]
        if pair[0] < pair[1] and len(chosen) + len(new) <= count:
            chosen += new
        if len(chosen) >= min(count, len(matrix)):
            break
    return sorted(chosen)


def draw(result: Result) -> Figure:
    """Scatter and contours below the diagonal; all correlations as a map in the empty corner."""
    analysis = result.analysis
    draws = _some(analysis.stated.draws)
    matrix = correlation(draws)
    chosen = strongest(matrix)
    size = len(chosen) - 1
    if size < 1:
        return _nothing()
    figure = style.new_figure(1.2 + 1.12 * size, style.WIDTH_IN if size > 2 else 4.6)
    panels = _triangle(figure, size)
    names = [analysis.model.names[i] for i in chosen]
    every = analysis.stated.draws
    rows = [scale_of(every[:, i], analysis.model.unit(analysis.model.names[i])) for i in chosen]
    label = [style.named(n, row.unit, "\n") for n, row in zip(names, rows, strict=True)]
    scaled = draws[:, chosen] * [row.factor for row in rows]
    for (i, j), axes in panels.items():
        _pair(axes, scaled[:, j], scaled[:, i + 1], matrix[chosen[j], chosen[i + 1]])
        axes.label_outer()
    for i in range(size):
        panels[i, 0].set_ylabel(label[i + 1], fontsize=style.FONT)
        panels[size - 1, i].set_xlabel(label[i], fontsize=style.FONT)
    figure.align_labels()
    if size > 3:
        _map(figure, matrix, analysis.model.names)
    return figure


def _some(draws: NDArray[Any]) -> NDArray[Any]:
    """As many draws as the contours need."""
    most_draws = 8000
    return draws[:: max(len(draws) // most_draws, 1)]


def _triangle(figure: Figure, size: int) -> dict[tuple[int, int], Axes]:
    """Axes on and below the diagonal, by row and column; those of a row and a column share it."""
    grid = figure.add_gridspec(size, size)
    panels: dict[tuple[int, int], Axes] = {}
    for i in range(size):
        for j in range(i + 1):
            shared = {"sharex": panels.get((j, j)), "sharey": panels.get((i, 0))}
            panels[i, j] = figure.add_subplot(grid[i, j], **shared)
    return panels


def draw_on(axes: Axes, result: Result, x: str, y: str) -> None:
    """Two parameters on axes that are there."""
    model, draws = result.analysis.model, result.analysis.stated.draws
    chosen = _some(draws)[:, [model.names.index(n) for n in (x, y)]]
    rows = [scale_of(draws[:, model.names.index(n)], model.unit(n)) for n in (x, y)]
    across, up = (chosen * [row.factor for row in rows]).T
    _pair(axes, across, up, correlation(chosen)[0, 1])
    axes.set_xlabel(style.named(x, rows[0].unit), fontsize=style.FONT)
    axes.set_ylabel(style.named(y, rows[1].unit), fontsize=style.FONT)


def _pair(axes: Axes, x: NDArray[Any], y: NDArray[Any], rank_correlation: float) -> None:
    style.panel(axes, grid=False, size=style.FONT - 1)
    few = slice(None, None, max(len(x) // POINTS, 1))
    axes.plot(x[few], y[few], ".", color=style.MODEL, markersize=1.1, alpha=0.35, rasterized=True)
    ranges = [_wide(x), _wide(y)]
    (u, v), back = _turned(x, y)
    count, u_edges, v_edges = np.histogram2d(u, v, 22, [_wide(u), _wide(v)])
    levels = credible(count, u_edges, v_edges, u, v)
    if np.all(np.diff(levels) > 0):
        grid = np.meshgrid(_middle(u_edges), _middle(v_edges))
        axes.contour(*back(grid), _smooth(count).T, levels, colors=style.DATA, linewidths=0.7)
    axes.set_xlim(*ranges[0])
    axes.set_ylim(*ranges[1])
    axes.text(
        0.97,
        0.95,
        minus(f"{round(rank_correlation, 2) + 0.0:+.2f}"),
        transform=axes.transAxes,
        ha="right",
        va="top",
        fontsize=style.SMALL,
        bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 1},
    )
    from matplotlib.ticker import MaxNLocator

    axes.xaxis.set_major_locator(MaxNLocator(2))
    axes.yaxis.set_major_locator(MaxNLocator(3))
    axes.ticklabel_format(useOffset=False, style="plain")


def _map(figure: Figure, matrix: NDArray[Any], names: tuple[str, ...]) -> None:
    """The correlations of all parameters; number and colour say the same."""
    axes = figure.add_axes((0.60, 0.675, 0.385, 0.285))
    axes.set_in_layout(False)
    axes.imshow(matrix, cmap="PuOr", vmin=-1.3, vmax=1.3)
    marks, names = range(len(names)), tuple(style.short(name) for name in names)
    axes.set_xticks(marks, names, rotation=90, fontsize=style.SMALL - 0.5)
    axes.set_yticks(marks, names, fontsize=style.SMALL - 0.5)
    axes.tick_params(length=0)
    axes.set_title("rank correlation × 10, all parameters", fontsize=style.SMALL + 0.5)
    dark = 0.85  # from which black on the colour cannot be read
    for i in marks:
        for j in range(i):
            text = minus(f"{10 * matrix[i, j]:.0f}".replace("-0", "0"))
            look: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": style.SMALL - 1.5}
            look["color"] = "white" if abs(matrix[i, j]) > dark else style.DATA
            axes.text(j, i, text, **look)
            axes.text(i, j, text, **look)


def _turned(x: NDArray[Any], y: NDArray[Any]) -> tuple[NDArray[Any], Callable[[Any], NDArray[Any]]]:
    """Draws along their principal axes, (2, n), and the way back.

    There a narrow ridge is as round as any cloud, and a histogram does not blur it.
    """
    points = np.array([x, y])
    centre, spread = points.mean(axis=1), points.std(axis=1)
    spread = np.where(spread > 0, spread, 1.0)
    plain = (points - centre[:, None]) / spread[:, None]
    axes = np.linalg.eigh(np.cov(plain))[1]

    def back(grid: Any) -> NDArray[Any]:
        placed = np.einsum("ij,j...->i...", axes, np.asarray(grid))
        return placed * spread[:, None, None] + centre[:, None, None]

    return axes.T @ plain, back


def _wide(values: NDArray[Any]) -> tuple[float, float]:
    low, high = (float(v) for v in np.quantile(values, (0.002, 0.998)))
    margin = 0.06 * (high - low) or 1.0
    return low - margin, high + margin


def _middle(edges: NDArray[Any]) -> NDArray[Any]:
    return 0.5 * (edges[1:] + edges[:-1])


def _smooth(count: NDArray[Any]) -> NDArray[Any]:
    from scipy.ndimage import gaussian_filter

    return gaussian_filter(count, 1.0, mode="constant")


def credible(
    count: NDArray[Any],
    x_edges: NDArray[Any],
    y_edges: NDArray[Any],
    x: NDArray[Any],
    y: NDArray[Any],
) -> NDArray[Any]:
    """Heights of the contours that hold the shares LEVELS of the draws (x, y), ascending.

    Read at the draws themselves: a histogram that is smoothed is wider than they are.
    """
    from scipy.ndimage import map_coordinates

    places = [
        (values - edges[0]) / (edges[1] - edges[0]) - 0.5  # in bins, from the middle of the first
        for values, edges in ((x, x_edges), (y, y_edges))
    ]
    height = map_coordinates(_smooth(count), places, order=1, mode="constant")
    return np.quantile(height, [1 - level for level in LEVELS])


def _nothing() -> Figure:
    figure = style.new_figure(0.8)
    figure.text(0.5, 0.5, "One parameter: there are no pairs.", ha="center", va="center")
    return figure
