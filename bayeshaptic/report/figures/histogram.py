"""A stacked histogram of the critical stiffness by binding crossing, with its risks."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.quantities import percent
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.estimates import RISKS
from bayeshaptic.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bayeshaptic.stability.critical import CriticalStiffness

BINS = 60


def stacked(
    axes: Axes,
    limit: CriticalStiffness,
    values: Floats,
    edges: Floats,
    width: Floats | None = None,
) -> None:
    """One colour and hatch a binding crossing, stacked.

    Parameters
    ----------
    axes : Axes
    limit : CriticalStiffness
    values : ndarray, shape (N,)
        The samples of `limit` as they are on the axis; what is not finite is left out.
    edges : ndarray, shape (K + 1,)
    width : ndarray, shape (K,), optional
        What the density is over; by default the widths between `edges`.
    """
    width = np.diff(edges) if width is None else width
    base = np.zeros(len(edges) - 1)
    for number, crossing in enumerate(limit.crossings):
        part = values[(limit.group == number) & np.isfinite(values)]
        height = np.histogram(part, edges)[0] / (len(values) * width)
        colour = style.CYCLE[number % len(style.CYCLE)]
        axes.stairs(
            base + height,
            edges,
            baseline=base,
            fill=True,
            facecolor=colour,
            alpha=0.55,
            edgecolor=style.DATA,
            linewidth=0.0,
            hatch=style.HATCHES[number % len(style.HATCHES)],
            label=f"{crossing.label}: {percent(crossing.probability)}",
        )
        axes.stairs(base + height, edges, baseline=base, color=colour, linewidth=0.8)
        base = base + height


def risk_lines(
    axes: Axes, limit: CriticalStiffness, place: Callable[[float], float], of_what: str
) -> None:
    """A line at each safe stiffness that is on the axis; `place` tells where."""
    low, high = axes.get_xlim()
    for number, risk in enumerate(RISKS):
        safe = limit.safe(risk)
        if safe and low <= place(safe) <= high:
            axes.axvline(
                place(safe),
                color=style.DATA,
                linewidth=1.0,
                linestyle=style.DASHES[1:][number],
                label=f"{percent(risk)} risk {of_what}",
            )
