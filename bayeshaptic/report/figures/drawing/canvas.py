"""A figure as pixels and as SVG at once: its parts are gone through a single time.

Two thirds of what a picture costs is matplotlib going through the parts of its figure, in Python,
whatever the format is. `draw_both` lays a figure out and draws it once; each stroke goes to two
renderers.
"""

from __future__ import annotations

import io
from base64 import b64encode
from typing import Any

import numpy as np
from matplotlib._path import convert_to_string  # type: ignore[attr-defined]
from matplotlib.backend_bases import FigureCanvasBase, GraphicsContextBase, RendererBase
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.colors import rgb2hex
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D, Bbox, TransformedPath

from bayeshaptic.report.figures.drawing.letters import heights, in_pixels, letters
from bayeshaptic.report.figures.drawing.png import png
from bayeshaptic.types import Bytes

_POINTS_PER_INCH = 72.0  # the unit of SVG is a point


def draw_both(figure: Figure) -> tuple[Bytes, str]:
    """Lay `figure` out and draw it.

    Returns
    -------
    pixels : ndarray of uint8, shape (height, width, 3)
    svg : str
        A whole SVG file.
    """
    both = _Both(figure)
    _Canvas(figure, both)
    figure.draw(both)
    return both.finish()


class _Canvas(FigureCanvasBase):
    """Lets the layout measure texts where they will be drawn: once."""

    def __init__(self, figure: Figure, both: _Both) -> None:
        super().__init__(figure)
        self.get_renderer = lambda: both


class _Vector(RendererSVG):
    """Writes paths to the hundredth of a point, which is enough, and texts as texts.

    A text can be searched for and read out, and is some 150 bytes; as outlines it is a kilobyte,
    and a fifth of what a picture costs.  It is as wide as it was laid out whatever font the reader
    has.
    """

    def draw_text(
        self,
        gc: Any,
        x: float,
        y: float,
        s: str,
        prop: Any,
        angle: float,
        ismath: Any = False,
        mtext: Any = None,
    ) -> None:
        if ismath:
            super().draw_text(gc, x, y, s, prop, angle, ismath, mtext)
            return
        at = {"x": f"{x:.2f}", "y": f"{y:.2f}"}
        if angle:
            at["transform"] = f"rotate({-angle:g} {at['x']} {at['y']})"
        width = letters(s, prop, self.image_dpi).size[0] * _POINTS_PER_INCH / self.image_dpi
        if width > 0 and len(s) > 1:
            at |= {"textLength": f"{width:.2f}", "lengthAdjust": "spacingAndGlyphs"}
        look = f"font-size: {prop.get_size_in_points():g}px"
        for name, value in (("weight", prop.get_weight()), ("style", prop.get_style())):
            look += "" if value in ("normal", 400) else f"; font-{name}: {value}"
        red, green, blue, alpha = gc.get_rgb()
        if (red, green, blue) != (0, 0, 0):
            look += f"; fill: {rgb2hex((red, green, blue))}"
        if alpha != 1:
            look += f"; opacity: {alpha:g}"
        clip: dict[str, str] = self._get_clip_attrs(gc)  # type: ignore[attr-defined]
        if clip:  # what is turned is clipped as it stands
            self.writer.start("g", **clip)
        self.writer.element("text", s, style=look, attrib=at)
        if clip:
            self.writer.end("g")

    def _convert_path(
        self,
        path: Any,
        transform: Any = None,
        clip: Any = None,
        simplify: Any = None,
        sketch: Any = None,
    ) -> str:
        corners = (0.0, 0.0, self.width, self.height) if clip else None
        commands = [b"M", b"L", b"Q", b"C", b"z"]
        text = convert_to_string(path, transform, corners, simplify, sketch, 2, commands, False)
        return str(text, "ascii")


class _Both(RendererBase):
    """Hands every stroke to Agg, in pixels, and to the SVG writer, in points."""

    def __init__(self, figure: Figure) -> None:
        super().__init__()
        width, height = figure.get_size_inches()
        self.dpi = figure.dpi
        self._size = round(figure.bbox.width), round(figure.bbox.height)
        self._pixels = RendererAgg(*self._size, self.dpi)
        self._layer = self._pixels  # another one while parts are drawn that the SVG has as pixels
        self._text = io.StringIO()
        self._vector = _Vector(
            width * _POINTS_PER_INCH,
            height * _POINTS_PER_INCH,
            self._text,
            image_dpi=int(self.dpi),
            metadata={"Date": None, "Creator": None},
        )
        self._factor = _POINTS_PER_INCH / self.dpi
        self._to_points = Affine2D().scale(self._factor)

    def finish(self) -> tuple[Bytes, str]:
        self._vector.finalize()
        return np.asarray(self._pixels.buffer_rgba())[..., :3], self._text.getvalue()

    def _in_points(self, gc: GraphicsContextBase) -> GraphicsContextBase:
        """The same pen, clipped where the SVG's coordinates are."""
        other = self._vector.new_gc()
        other.copy_properties(gc)
        box = gc.get_clip_rectangle()
        if box is not None:
            other.set_clip_rectangle(Bbox(box.get_points() * self._factor))
        path, place = gc.get_clip_path()
        if path is not None and place is not None:
            # matplotlib's stub of get_clip_path is wrong: `path` is a Path.
            other.set_clip_path(TransformedPath(path, place + self._to_points))  # type: ignore
        return other

    @property
    def _in_pixels_only(self) -> bool:
        return self._layer is not self._pixels

    def _rasters(self) -> tuple[RendererAgg, ...]:
        return (self._pixels, self._layer) if self._in_pixels_only else (self._pixels,)

    def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
        for raster in self._rasters():
            raster.draw_path(gc, path, transform, rgbFace)
        if not self._in_pixels_only:
            place = transform + self._to_points
            self._vector.draw_path(self._in_points(gc), path, place, rgbFace)

    def draw_markers(
        self,
        gc: Any,
        marker_path: Any,
        marker_trans: Any,
        path: Any,
        trans: Any,
        rgbFace: Any = None,
    ) -> None:
        for raster in self._rasters():
            raster.draw_markers(gc, marker_path, marker_trans, path, trans, rgbFace)
        if not self._in_pixels_only:
            shape, place = marker_trans + self._to_points, trans + self._to_points
            self._vector.draw_markers(self._in_points(gc), marker_path, shape, path, place, rgbFace)

    def draw_path_collection(
        self,
        gc: Any,
        master_transform: Any,
        paths: Any,
        all_transforms: Any,
        offsets: Any,
        offset_trans: Any,
        *looks: Any,
        **more: Any,
    ) -> None:
        for raster in self._rasters():
            raster.draw_path_collection(
                gc, master_transform, paths, all_transforms, offsets, offset_trans, *looks, **more
            )
        if not self._in_pixels_only:
            self._vector.draw_path_collection(
                self._in_points(gc),
                master_transform + self._to_points,
                paths,
                all_transforms,
                offsets,
                offset_trans + self._to_points,
                *looks,
                **more,
            )

    def draw_image(self, gc: Any, x: float, y: float, im: Any, transform: Any = None) -> None:
        for raster in self._rasters():
            raster.draw_image(gc, x, y, im)
        if not self._in_pixels_only:
            place = x * self._factor, y * self._factor
            self._vector.draw_image(self._in_points(gc), *place, im)

    def draw_text(
        self,
        gc: Any,
        x: float,
        y: float,
        s: str,
        prop: Any,
        angle: float,
        ismath: Any = False,
        mtext: Any = None,
    ) -> None:
        for raster in self._rasters():
            if ismath:
                raster.draw_text(gc, x, y, s, prop, angle, ismath, mtext)
            else:
                in_pixels(raster, gc, x, y, s, prop, angle)
        if not self._in_pixels_only:
            place = x * self._factor, y * self._factor
            self._vector.draw_text(self._in_points(gc), *place, s, prop, angle, ismath)

    def start_rasterizing(self) -> None:
        self._layer = RendererAgg(*self._size, self.dpi)

    def stop_rasterizing(self) -> None:
        """What was drawn since becomes an image of the SVG."""
        image = np.asarray(self._layer.buffer_rgba())
        self._layer = self._pixels
        rows = np.flatnonzero(image[..., 3].any(axis=1))
        if not len(rows):
            return
        part = image[rows[0] : rows[-1] + 1]
        columns = np.flatnonzero(part[..., 3].any(axis=0))
        part = part[:, columns[0] : columns[-1] + 1]
        height, width, _ = part.shape
        sides = {"x": columns[0], "y": rows[0], "width": width, "height": height}
        self._vector.writer.element(
            "image",
            attrib={
                "xlink:href": "data:image/png;base64," + b64encode(png(part, self.dpi)).decode()
            },
            **{name: f"{side * self._factor:.2f}" for name, side in sides.items()},
        )

    def open_group(self, s: str, gid: str | None = None) -> None:
        self._vector.open_group(s, gid)

    def close_group(self, s: str) -> None:
        self._vector.close_group(s)

    def get_text_width_height_descent(self, s: str, prop: Any, ismath: Any) -> Any:
        if ismath:
            return self._pixels.get_text_width_height_descent(s, prop, ismath)
        return letters(s, prop, self.dpi).size

    def _get_font_height_metrics(self, font: Any) -> tuple[float | None, ...]:
        """What matplotlib reads from two tables of a font at each look at each text."""
        return heights(font, self.dpi)

    def get_canvas_width_height(self) -> tuple[float, float]:
        return self._size

    def points_to_pixels(self, points: Any) -> Any:
        return self._pixels.points_to_pixels(points)

    def option_image_nocomposite(self) -> bool:
        return True

    def flipy(self) -> bool:
        return True
