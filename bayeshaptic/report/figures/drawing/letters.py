"""Texts as pixels, each set once: most of a report's texts come several times.

matplotlib sets every text anew, to measure it and to draw it, letter by letter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import RendererAgg, get_hinting_flag
from matplotlib.font_manager import FontProperties, fontManager, get_font

from bayeshaptic.types import Bytes

_UPRIGHT, _UPWARDS = 0.0, 90.0  # degrees
_KEPT = 8192  # texts; a report has some 400


@dataclass(frozen=True)
class Letters:
    """A text in pixels.

    Attributes
    ----------
    ink : ndarray of uint8, shape (height, width)
        How much of each pixel is covered.
    size : tuple of float
        Width, height and descent, pixels.
    offset : tuple of float
        From the text's left end and descent to the first column and the last row of `ink`.
    """

    ink: Bytes
    size: tuple[float, float, float]
    offset: tuple[float, float]


def letters(text: str, font: FontProperties, dpi: float) -> Letters:
    """A text without mathematics, in pixels."""
    return _set(text, font.copy(), dpi)  # a copy: fonts of texts may change


@lru_cache(_KEPT)
def _set(text: str, font: FontProperties, dpi: float) -> Letters:
    prepared: Any = RendererAgg(1, 1, dpi)._prepare_font(font)  # type: ignore[attr-defined]
    prepared.set_text(text, 0.0, flags=get_hinting_flag())
    prepared.draw_glyphs_to_bitmap(antialiased=True)
    units = 64.0  # of FreeType a pixel
    width, height = prepared.get_width_height()
    across, down = prepared.get_bitmap_offset()
    return Letters(
        np.array(prepared.get_image(), np.uint8),
        (width / units, height / units, prepared.get_descent() / units),
        (across / units, down / units),
    )


def heights(font: FontProperties, dpi: float) -> tuple[float | None, ...]:
    """Ascent, descent and gap between lines in pixels; none where the font does not say so."""
    return _heights(font.copy(), dpi)


@lru_cache(_KEPT)
def _heights(font: FontProperties, dpi: float) -> tuple[float | None, ...]:
    face: Any = get_font(fontManager._find_fonts_by_props(font))  # type: ignore[attr-defined]
    table = face.get_sfnt_table("OS/2")
    if table is None:
        return None, None, None
    pixels = 1 / face.get_sfnt_table("head")["unitsPerEm"] * font.get_size_in_points() * dpi / 72
    names = "sTypoAscender", "sTypoDescender", "sTypoLineGap"
    ascent, below, gap = (table[name] * pixels for name in names)
    return ascent, -below, gap


def in_pixels(
    renderer: RendererAgg,
    gc: Any,
    x: float,
    y: float,
    text: str,
    font: FontProperties,
    angle: float,
) -> None:
    """Draw a text without mathematics, its origin on a whole pixel; `y` is counted downwards."""
    if angle not in (_UPRIGHT, _UPWARDS):
        renderer.draw_text(gc, x, y, text, font, angle)
        return
    found = letters(text, font, renderer.dpi)
    descent, (across, down) = found.size[2], found.offset
    ink, column, row = found.ink, round(x + across), round(y + down + descent)
    if angle == _UPWARDS:
        ink, row = np.rot90(ink), round(y - across) - 1
        column = round(x + down + descent) - ink.shape[1] + 1
    *colour, alpha = gc.get_rgb()
    image = np.empty((*ink.shape, 4), np.uint8)
    image[..., :3] = [round(255 * part) for part in colour]
    image[..., 3] = ink * alpha
    upwards = np.ascontiguousarray(image[::-1])
    pen = renderer.new_gc()
    pen.copy_properties(gc)
    pen.set_alpha(1.0)  # it is in the image
    renderer.draw_image(pen, column, renderer.height - row - 1, upwards)
