"""One look for all figures: readable on paper, in grey, and by the colour-blind.

Everything is set on the figure and not in matplotlib's global state, so that reports can be drawn
in several threads; what a user has set there stays outside (`drawing/look.py`). Colours are Okabe
and Ito's; what differs in colour also differs in line style or marker.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.quantities import minus
from bayeshaptic.report.figures.drawing.hover import panels
from bayeshaptic.report.figures.drawing.png import png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import XAxis, YAxis
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
_LAYER = "layer-"
MOST_SVG = 120_000  # characters: beyond, whichever is smaller, PNG or SVG, is in the page


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """An empty figure with constrained layout, outside of pyplot."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from bayeshaptic.report.figures.drawing.axes import Page

    figure = Page(figsize=(width_in, height_in), dpi=DPI, layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def two_panels(height_in: float, draw_on: Callable[[Sequence[Axes]], None]) -> Figure:
    """A figure of two panels on one frequency axis, drawn by `draw_on`."""
    figure = new_figure(height_in)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    draw_on(panels)
    figure.align_ylabels(panels)
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


def shared_legend(figure: Figure, handles: Sequence[Any], place: str, columns: int) -> None:
    """The same of all panels, at a side of the figure."""
    settings: dict[str, Any] = {"loc": f"outside {place}", "ncols": columns}
    figure.legend(handles=handles, fontsize=SMALL + 0.5, frameon=False, **settings)


def rows(axes: Axes, names: Sequence[str], right: Sequence[str] = ()) -> None:
    """A row a name, the first one on top; `right` stands beside the rows' other end."""
    from matplotlib.ticker import FixedFormatter, FixedLocator

    axes.yaxis.set_major_locator(FixedLocator(range(len(names))))
    axes.yaxis.set_major_formatter(FixedFormatter(names))
    axes.set_ylim(max(len(names), 1) - 0.4, -0.6)
    for place, text in enumerate(right):
        axes.annotate(
            text,
            (1.0, place),
            (3.5, 0.0),
            xycoords=axes.get_yaxis_transform(),
            textcoords="offset points",
            va="center_baseline",
            fontsize=FONT - 0.5,
            annotation_clip=False,
        )


def log_scale(axis: XAxis | YAxis, subs: Sequence[int] = (1,)) -> None:
    """A logarithmic axis with plain numbers at `subs` times the powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    axis.set_major_locator(LogLocator(10, subs=subs))
    axis.set_major_formatter(FuncFormatter(plain))
    axis.set_minor_formatter(NullFormatter())


def fixed_ticks(axis: XAxis | YAxis, places: Sequence[float]) -> None:
    """Plain numbers at `places`, and no ticks between them."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    axis.set_major_locator(FixedLocator(places))
    axis.set_major_formatter(FuncFormatter(plain))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def frequency_axis(axes: Axes, low_hz: float, high_hz: float, label: str = "") -> None:
    """A logarithmic frequency axis with plain numbers (1, 10, 100) on it."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

    axes.set_xscale("log")
    axes.set_xlim(low_hz, high_hz)
    narrow = high_hz / low_hz < 30
    axes.xaxis.set_major_locator(LogLocator(10, subs=(1, 2, 5) if narrow else (1,)))
    axes.xaxis.set_major_formatter(FuncFormatter(plain))
    axes.xaxis.set_minor_locator(NullLocator())
    _minor_marks(axes, low_hz, high_hz)
    axes.set_xlabel(label, fontsize=FONT)


def _minor_marks(axes: Axes, low: float, high: float) -> None:
    """Short ticks at 2 to 9 times the powers of ten, as markers of one invisible line.

    matplotlib's own are four objects each, and take a third of the time of such a figure.
    """
    decades = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)))
    places = np.outer(decades, np.arange(2, 10)).ravel()
    places = places[(places >= low) & (places <= high)]
    (line,) = axes.plot(
        places,
        np.zeros(len(places)),
        linestyle="none",
        marker=3,  # a tick downwards
        markersize=2,
        markeredgewidth=0.4,
        color="black",
        transform=axes.get_xaxis_transform(),
        clip_on=False,
        label="_minor ticks",
        scalex=False,
        scaley=False,
    )
    line.set_in_layout(False)


_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def plain(value: float, _: object = None) -> str:
    """A tick's number with a proper minus; powers of ten are written 10³ from 10⁵ on."""
    text = f"{value:g}"
    if value and not 1e-3 < abs(value) < 1e5:
        digits, _e, power = f"{value:e}".partition("e")
        factor = f"{float(digits):g}"
        raised = f"10{str(int(power)).translate(_RAISED)}"
        text = raised if factor == "1" else f"{factor}·{raised}"
    return minus(text)


def short(name: str) -> str:
    """A parameter's name in words: ``"delay"`` for delay_s, ``"mode frequency"`` for mode_hz."""
    without_unit = re.sub(r"_s(?=_|$)", "", name).replace("_hz", "_frequency")
    return without_unit.replace("_", " ")


def called(name: str, most: int = 44) -> str:
    """A name that a user gave, as a figure has room for it; tables have all of it.

    `most` characters are half of the page's width.
    """
    half = most // 2 - 1
    return name if len(name) <= most else f"{name[:half]}…{name[-half:]}"


def named(name: str, unit: str, between: str = " ") -> str:
    """A parameter's name in words, and its unit where it has one."""
    return f"{short(name)}{between}[{unit}]" if unit else short(name)


@dataclass(frozen=True)
class Drawn:
    """A figure that is drawn.

    Attributes
    ----------
    png : bytes
        For the file beside the page.
    svg : str or None
        For the page itself; None where it is too large for one.
    readings : list
        Values under the pointer; see `bayeshaptic.report.figures.drawing.hover`.
    """

    png: bytes = field(repr=False)
    svg: str | None = field(default=None, repr=False)
    readings: Sequence[Mapping[str, Any]] = field(default=(), repr=False)


def drawn(figure: Figure, name: str) -> Drawn:
    """The figure as PNG, and as SVG where that is small; `name` tells its parts from others'.

    The same figure gives the same bytes.
    """
    from bayeshaptic.report.figures.drawing.canvas import draw_both

    pixels, text = draw_both(figure)
    picture, vector = png(pixels, DPI), for_a_page(text, name)
    base64 = 4 / 3  # characters a byte of a picture in a page
    most = max(MOST_SVG, base64 * len(picture))
    return Drawn(picture, vector if len(vector) <= most else None, panels(figure))


def layer(artists: Iterable[Any], name: str) -> None:
    """Put artists into a layer of the page, "before" or "after", which its reader may hide."""
    for artist in artists:
        artist.set_gid(f"{_LAYER}{name}")


def for_a_page(svg: str, name: str) -> str:
    """An SVG file as an element of a page.

    Without what a page does not need; parts are named after the figure, so that those of several
    figures do not meet.
    """
    text = svg[svg.index("<svg") :].replace(" \n", " ")
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = text.replace(f'id="{_LAYER}', 'class="')
    used = set(re.findall(r'href="#([^"]+)"', text)) | set(re.findall(r"url\(#([^)]+)\)", text))
    names = {key: f"{name}-{number}" for number, key in enumerate(_ids(text)) if key in used}
    text = re.sub(r' id="([^"]+)"', lambda m: f' id="{names[m[1]]}"' if m[1] in used else "", text)
    text = re.sub(r'href="#([^"]+)"', lambda m: f'href="#{names[m[1]]}"', text)
    text = re.sub(r"url\(#([^)]+)\)", lambda m: f"url(#{names[m[1]]})", text)
    return _joined(re.sub(r">\s+<", "><", text).strip())


_D = r' d="([^"]*)"'
# Strokes without a filling; of translucent ones each is its own, or crossings would look lighter.
_BARE = r'<path d="([^"]*)"((?: clip-path="[^"]*")? style="fill: none(?:(?!opacity)[^"])*")/>'
_USE = r'<use xlink:href="[^"]*" x="[^"]*" y="[^"]*"( style="[^"]*")/>'


def _joined(text: str) -> str:
    """Runs of strokes of one look as one path, runs of markers of one look in one group."""

    def strokes(run: re.Match[str]) -> str:
        return f'<path d="{" ".join(re.findall(_D, run[0]))}"{run[2]}/>'

    def markers(run: re.Match[str]) -> str:
        return f"<g{run[1]}>{run[0].replace(run[1], '')}</g>"

    text = re.sub(_BARE + r'(?:<path d="[^"]*"\2/>)+', strokes, text)
    text = re.sub(_USE + r'(?:<use xlink:href="[^"]*" x="[^"]*" y="[^"]*"\1/>)+', markers, text)
    return re.sub(r'( [xy]=")(-?\d+\.\d{3,})', lambda m: f"{m[1]}{float(m[2]):.2f}", text)


def _ids(text: str) -> list[str]:
    return list(dict.fromkeys(re.findall(r' id="([^"]+)"', text)))
