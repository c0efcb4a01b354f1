"""A figure drawn once is what matplotlib draws in two goes, one a format."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.text import Text
from matplotlib.ticker import NullFormatter
from PIL import Image

from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.drawing.axes import Plain
from bayeshaptic.report.figures.drawing.canvas import draw_both
from bayeshaptic.report.figures.drawing.letters import in_pixels


def _figure(texts: bool = True) -> Figure:
    """One of each thing that figures are made of; texts are laid out, and drawn or not."""
    rng = np.random.default_rng(0)
    figure = style.new_figure(3.3)
    left, right = figure.subplots(1, 2)
    x = np.linspace(0, 1, 30)
    left.plot(x, x**2, "o--", label="line", markersize=3)
    left.fill_between(x, x, x + 0.2, alpha=0.3)
    left.plot(rng.random(50), rng.random(50), ".", rasterized=True)
    left.stairs([1, 2], [0, 0.5, 1], fill=True, hatch="//", label="stairs")
    style.legend(style.panel(left, "x, ms", "y"))
    right.imshow(rng.random((4, 4)))
    right.scatter(range(4), range(4), c=range(4))
    right.set_yscale("log")
    right.yaxis.set_major_formatter(style.plain)
    right.yaxis.set_minor_formatter(NullFormatter())
    if not texts:
        for axes in (left, right):
            axes.tick_params(labelcolor=(0, 0, 0, 0))
        for text in figure.findobj(Text):
            text.set_alpha(0)
    return figure


_IMAGE, _TEXT = r"<image[^>]*>", r"<text[^>]*>"


def _numbers(svg: str) -> list[float]:
    """Coordinates of paths and of what is put somewhere, images and texts left out, in order."""
    places = re.findall(r'(?: d| x| y| transform)="([^"]*)"', re.sub(f"{_IMAGE}|{_TEXT}", "", svg))
    return [float(n) for text in places for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def test_both_formats_are_those_of_matplotlib() -> None:
    figure = _figure(texts=False)
    pixels, svg = draw_both(figure)
    figure.set_layout_engine("none")  # as it was laid out
    png, other = io.BytesIO(), io.StringIO()
    figure.savefig(png, format="png", dpi=style.DPI)
    with rc_context({"svg.fonttype": "none"}):
        figure.savefig(other, format="svg", dpi=style.DPI, metadata={"Date": None, "Creator": None})
    assert np.array_equal(pixels, np.asarray(Image.open(png).convert("RGB")))
    ours, theirs = _numbers(svg), _numbers(other.getvalue())
    assert len(ours) == len(theirs) > 500
    # Images are placed in whole pixels here, in points there.
    assert ours == pytest.approx(theirs, abs=1.01 * 72 / style.DPI)
    placed, wanted = _places(svg), _places(other.getvalue())
    assert len(placed) == len(wanted) == 2
    # A cloud is cut to its own pixels in both.
    assert np.array(placed) == pytest.approx(np.array(wanted), abs=2.01 * 72 / style.DPI)


def _places(svg: str) -> list[list[float]]:
    """Left, top, width and height of each image."""
    found = []
    for image in re.findall(_IMAGE, svg):
        sides = {n: float(v) for n, v in re.findall(r' (x|y|width|height)="([^"]*)"', image)}
        if "scale(1 -1)" in image:  # mirrored about zero
            sides["y"] = -sides["y"]
        found.append([sides[name] for name in ("x", "y", "width", "height")])
    return found


def test_texts_of_a_page_are_texts_as_wide_as_they_were_laid_out() -> None:
    figure = _figure()
    figure.text(0.5, 0.02, "a < b & c", size=7.5, weight="bold", color="red", alpha=0.5)
    _, svg = draw_both(figure)
    points = 72 / style.DPI
    found = {}
    for attributes, content in re.findall("<text ([^>]*)>([^<]*)</text>", svg):
        found[content] = dict(re.findall(r'([\w]+)="([^"]*)"', attributes))
    looks = found["a &lt; b &amp; c"]["style"]
    assert looks == "font-size: 7.5px; font-weight: bold; fill: #ff0000; opacity: 0.5"
    texts = [text for text in figure.findobj(Text) if text.get_text() in found]
    assert {"x, ms", "y", "line", "stairs"} <= {text.get_text() for text in texts}
    for text in texts:
        box = text.get_window_extent(figure.canvas.get_renderer())  # type: ignore[attr-defined]
        of = found[text.get_text()]
        turned = "transform" in of
        width = box.height if turned else box.width
        start = (figure.bbox.height - box.y0) if turned else box.x0
        assert float(of["y" if turned else "x"]) == pytest.approx(start * points, abs=points)
        assert ("textLength" in of) == (len(text.get_text()) > 1)  # one letter is not stretched
        if "textLength" in of:
            assert float(of["textLength"]) == pytest.approx(width * points, abs=points)


@pytest.mark.parametrize("words", ["ace", "two\nlines, \u00c5g", ""])
@pytest.mark.parametrize("weight", ["normal", "bold"])
def test_texts_are_as_high_as_matplotlib_finds_them(words: str, weight: str) -> None:
    figure = style.new_figure(1.0)
    text = figure.text(0.3, 0.4, words, size=style.SMALL, weight=weight)
    theirs = text.get_window_extent(RendererAgg(400, 100, style.DPI)).bounds
    draw_both(figure)
    ours = text.get_window_extent(figure.canvas.get_renderer()).bounds  # type: ignore[attr-defined]
    assert ours == pytest.approx(theirs)


@pytest.mark.parametrize("angle", [0.0, 90.0])
def test_texts_are_those_of_matplotlib_on_whole_pixels(angle: float) -> None:
    font = FontProperties(size=style.FONT)
    drawn = []
    for draw in (in_pixels, RendererAgg.draw_text):
        page = RendererAgg(200, 200, style.DPI)
        pen = page.new_gc()
        pen.set_foreground((0.2, 0.4, 0.8, 0.5), isRGBA=True)
        draw(page, pen, 100.3, 120.6, "gain, \N{GREEK SMALL LETTER MU}m", font, angle)
        drawn.append(np.asarray(page.buffer_rgba()).astype(float))
    ours, theirs = drawn
    assert ours[..., 3].max() == pytest.approx(theirs[..., 3].max(), abs=1)
    inked = ours[..., 3] > 0
    assert np.abs(ours[inked][:, :3] - theirs[theirs[..., 3] > 0][0, :3]).max() <= 12  # rounding
    places = np.indices((200, 200))
    ink, middle = [], []
    for picture in (ours, theirs):
        ink.append(picture[..., 3].sum())
        middle.append((places * picture[..., 3]).sum(axis=(1, 2)) / ink[-1])
    assert ink[0] == pytest.approx(ink[1], rel=0.05)
    assert np.abs(middle[0] - middle[1]).max() < 1.0  # half a pixel of the text, half of a letter


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_axes_of_few_strokes_look_like_those_of_matplotlib(scale: str) -> None:
    def picture(kind: type[Axes]) -> np.ndarray:
        figure = style.new_figure(4.0)
        top, bottom = figure.subplots(2, 1, subplot_kw={"axes_class": kind})
        style.panel(top, "x, ms", "y")
        top.plot([1e3, 3e5], [1.0, 2e-7])
        top.set_yscale(scale)
        style.panel(bottom, "z")
        bottom.secondary_xaxis("top")
        bottom.set_xticks([0, 1], ["one", "two"], rotation=90)
        bottom.set_yticks([0, 1, 2], ["first", "second\nline", "beyond the end"])
        bottom.set_ylim(1.5, -0.5)
        figure.align_ylabels([top, bottom])
        return draw_both(figure)[0].astype(int)

    off = np.abs(picture(Axes) - picture(Plain)).max(axis=2)
    # Grid lines are one stroke, clipped where two translucent edges lay on each other.
    assert np.mean(off > 0) < 0.001
