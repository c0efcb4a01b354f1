"""The critical stiffness over parameters of the design, with the crossing that binds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.quantities import Scale, scale
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.drawing.hover import Reading, note

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.stability.guidance.sweep import Sweep


def draw(sweeps: tuple[Sweep, ...]) -> Figure:
    """A panel a parameter; the line's colour and dashes say what binds there."""
    figure = style.new_figure(2.75)
    panels = np.atleast_1d(figure.subplots(1, len(sweeps)))
    every = np.concatenate([one.middle[np.isfinite(one.middle)] for one in sweeps])
    k = scale(float(np.median(every)) if len(every) else 1.0, sweeps[0].stiffness_unit)
    kinds = list(dict.fromkeys(kind for one in sweeps for kind in one.binds))
    for axes, one in zip(panels, sweeps, strict=True):
        _panel(axes, one, k, kinds)
    panels[0].set_ylabel(f"critical stiffness, {k.unit}", fontsize=style.FONT)
    _legend(figure, kinds, any(one.jumps for one in sweeps))
    return figure


def _panel(axes: Axes, one: Sweep, k: Scale, kinds: list[str]) -> None:
    factor = k.factor
    x = scale(float(one.values[-1]), one.unit)
    values = one.values * x.factor
    name = f"{one.name} + what is added" if one.added else one.name
    style.panel(axes, f"{name}, {x.unit}")
    axes.fill_between(
        values, one.low * factor, one.high * factor, color=style.MODEL, alpha=0.2, linewidth=0
    )
    rows = {
        "median": (one.middle * factor, k.unit),
        "90 %": (np.array([one.low, one.high]) * factor, k.unit),
    }
    note(axes, Reading(name, x.unit, values, rows))
    start = 0
    cuts = [i + 1 for i in range(len(values) - 1) if _changes(one, i)]
    for stop in [*cuts, len(values)]:
        number = kinds.index(one.binds[start])
        piece = slice(start, min(stop + 1, len(values)))
        axes.plot(
            values[piece],
            one.middle[piece] * factor,
            color=style.CYCLE[number],
            linestyle=style.DASHES[number],
            linewidth=1.6,
        )
        start = stop
    for jump in one.jumps:
        axes.axvline(jump.value * x.factor, color=style.OTHER, linewidth=0.9, linestyle=":")
    now = one.now * x.factor
    axes.plot([now], [np.interp(now, values, one.middle * factor)], "o", color=style.DATA, zorder=5)
    if not one.added:
        _log_axis(axes, values)
    axes.set_xlim(values[0], values[-1])
    known = one.high[np.isfinite(one.high)]
    axes.set_ylim(0.0, 1.08 * known.max() * factor if len(known) and known.max() > 0 else 1.0)


def _changes(one: Sweep, i: int) -> bool:
    return any(one.values[i] < jump.value < one.values[i + 1] for jump in one.jumps)


def _log_axis(axes: Axes, values: np.ndarray) -> None:
    low, high = np.log10(values[0]), np.log10(values[-1])
    nice = [d * 10.0**p for p in range(int(low) - 2, int(high) + 2) for d in (1, 2, 5)]
    axes.set_xscale("log")
    ticks = [tick for tick in nice if values[0] <= tick <= values[-1]]
    style.fixed_ticks(axes.xaxis, ticks)


def _legend(figure: Figure, kinds: list[str], jumps: bool) -> None:
    from matplotlib.lines import Line2D

    looks: list[dict[str, Any]] = [
        {"color": style.CYCLE[i], "linestyle": style.DASHES[i], "label": f"{kind} binds"}
        for i, kind in enumerate(kinds)
    ]
    handles = [Line2D([], [], linewidth=1.6, **look) for look in looks]
    handles.append(
        Line2D([], [], color=style.DATA, marker="o", linestyle="none", label="as measured")
    )
    if jumps:
        dots = Line2D([], [], color=style.OTHER, linestyle=":", label="another crossing binds")
        handles.append(dots)
    style.shared_legend(figure, handles, "lower center", len(handles))
