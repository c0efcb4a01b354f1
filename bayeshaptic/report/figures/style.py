"""One look for all figures: readable on paper, in grey, and by the colour-blind.

Everything is set on the figure and never in matplotlib's global state, so that reports can be
drawn in several threads. Colours are Okabe and Ito's; what differs in colour also differs in line
style or marker.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DATA = "#1a1a1a"
MODEL = "#0072b2"
OTHER = "#d55e00"
PRIOR = "#6e6e6e"
GRID = "#dddddd"
CYCLE = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#8a8a8a")
DASHES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (8, 2)), (0, (1, 3)))
HATCHES = ("", "////", "....", "xxxx", "\\\\\\\\", "++", "oo")

WIDTH_IN = 7.4  # the text width of an A4 page
FONT = 8.5
SMALL = 7.0
DPI = 140


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """An empty figure with constrained layout, outside of pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def panel(
    axes: Axes,
    x: str = "",
    y: str = "",
    *,
    title: str = "",
    grid: bool = True,
    size: float = FONT,
) -> Axes:
    """Give `axes` the common look and its labels (with units)."""
    axes.set_xlabel(x, fontsize=size)
    axes.set_ylabel(y, fontsize=size)
    if title:
        axes.set_title(title, fontsize=size, loc="left", fontweight="bold")
    axes.tick_params(labelsize=size - 0.5, width=0.6, length=3)
    axes.tick_params(which="minor", width=0.4, length=2)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_linewidth(0.6)
    if grid:
        axes.grid(True, color=GRID, linewidth=0.5)
        axes.set_axisbelow(True)
    return axes


def legend(axes: Axes, **options: Any) -> None:
    """A small legend without a frame, where it hides the least."""
    settings = {"fontsize": SMALL + 0.5, "frameon": False, "handlelength": 2.2} | options
    axes.legend(**settings)


def frequency_axis(axes: Axes, low_hz: float, high_hz: float, label: str = "") -> None:
    """A logarithmic frequency axis with plain numbers (1, 10, 100) on it."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set_xscale("log")
    axes.set_xlim(low_hz, high_hz)
    narrow = high_hz / low_hz < 30
    axes.xaxis.set_major_locator(LogLocator(10, subs=(1, 2, 5) if narrow else (1,)))
    axes.xaxis.set_major_formatter(FuncFormatter(plain))
    axes.xaxis.set_minor_locator(LogLocator(10, subs=range(2, 10)))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(label, fontsize=FONT)


def plain(value: float, _: object = None) -> str:
    """A tick's number without powers of ten, with a proper minus."""
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")


def short(name: str) -> str:
    """A parameter's name on an axis: the delay carries its unit there anyway."""
    return "delay" if name == "delay_s" else name


def png(figure: Figure) -> bytes:
    """The figure as PNG; the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    return buffer.getvalue()
