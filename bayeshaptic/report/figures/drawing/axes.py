"""Axes that are cheap to draw: the marks of an axis are three strokes, not five objects a tick.

matplotlib makes of every tick two short lines, a grid line and two texts, and updates all of them
at each look at the layout: half of what a figure costs.  `Plain` axes keep one tick as the pattern
of all.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis, Tick, XAxis, YAxis
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import NullLocator
from matplotlib.transforms import Bbox

from bayeshaptic.types import Floats


class Plain(Axes):
    """Axes with `_Few` marks."""

    _around: tuple[list[list[str]], Floats] | None = None

    def get_tightbbox(self, renderer: Any = None, *args: Any, **options: Any) -> Bbox | None:
        """What the axes take with their labels; measured once a layout while the labels stay.

        The layout looks twice, because labels change with the size: those of most axes do not.
        """
        if not options.get("for_layout_only"):
            return super().get_tightbbox(renderer, *args, **options)
        axes: tuple[Any, Any] = self.xaxis, self.yaxis
        labels = [marks.labels for axis in axes for marks in axis._update_ticks()]
        if self._around is None or self._around[0] != labels:
            whole = super().get_tightbbox(renderer, *args, **options)
            if whole is None:
                return None
            self._around = labels, whole.get_points() - self.bbox.get_points()
        return Bbox(self.bbox.get_points() + self._around[1])

    def _init_axis(self) -> None:
        self.xaxis = _AcrossAxis(self, clear=False)
        self.yaxis = _UpAxis(self, clear=False)
        for sides, axis in ((("bottom", "top"), self.xaxis), (("left", "right"), self.yaxis)):
            for side in sides:
                self.spines[side].register_axis(axis)


class Page(Figure):
    """A figure whose axes are `Plain`."""

    def add_subplot(self, *args: Any, **options: Any) -> Any:
        return super().add_subplot(*args, **{"axes_class": Plain, **options})

    def draw(self, renderer: Any) -> None:
        """Lay out anew, and draw."""
        for axes in self.axes:
            if isinstance(axes, Plain):
                axes._around = None
        super().draw(renderer)


class _Marks:
    """Where the marks of one kind stand, major or minor, and how they look."""

    def __init__(self, places: Floats, labels: list[str], pattern: Tick) -> None:
        self.places, self.labels, self.pattern = places, labels, pattern


class _Few(Axis):
    """An axis that draws all its grid lines at once, and all its ticks."""

    _along: str  # the coordinate of a mark on this axis: "x" or "y"

    def reset_ticks(self) -> None:
        """No ticks: those of `set_ticklabels` are made there."""
        self.majorTicks: list[Tick] = []
        self.minorTicks: list[Tick] = []
        self._patterns: dict[bool, Tick] = {}
        self._extents: dict[tuple[Any, ...], Bbox] = {}
        self._found: tuple[tuple[Any, ...], list[_Marks]] | None = None
        self._beside: tuple[Any, Floats, tuple[list[Bbox], list[Bbox]]] | None = None

    def set_tick_params(self, *args: Any, **options: Any) -> None:
        super().set_tick_params(*args, **options)
        self._patterns, self._extents, self._found = {}, {}, None

    def _get_ticks_position(self) -> Any:
        return 1  # below and left; axes on the other sides are secondary ones

    def _update_ticks(self) -> list[_Marks]:
        """The marks; asked for many times while a figure is laid out, found once a size."""
        kinds = (*vars(self.major).values(), *vars(self.minor).values())
        now = (*self.axes.bbox.size, *self.get_view_interval(), *kinds)
        if self._found is None or self._found[0] != now:
            both = (self._marks(major) for major in (True, False))
            self._found = now, [marks for marks in both if marks is not None]
        return self._found[1]

    def _marks(self, major: bool) -> _Marks | None:
        locator = self.get_major_locator() if major else self.get_minor_locator()
        if isinstance(locator, NullLocator):
            return None
        places = np.asarray(self.get_majorticklocs() if major else self.get_minorticklocs(), float)
        formatter = self.get_major_formatter() if major else self.get_minor_formatter()
        labels = formatter.format_ticks(places.tolist())
        low, high = np.sort(self.get_transform().transform(np.array(self.get_view_interval())))
        at = self.get_transform().transform(places)
        close = 1e-10  # of an axis: a mark this far beyond its end is on it
        margin = close * (high - low)
        seen = (at >= low - margin) & (at <= high + margin)
        return _Marks(
            places[seen], [t for t, s in zip(labels, seen, strict=True) if s], self._pattern(major)
        )

    def _pattern(self, major: bool) -> Tick:
        """A tick whose look the others have, too."""
        made = self.majorTicks if major else self.minorTicks
        if made:
            return made[0]
        if major not in self._patterns:
            make: Any = self._get_tick  # type: ignore[attr-defined]
            self._patterns[major] = make(major=major)
        return self._patterns[major]

    def _get_ticklabel_bboxes(self, ticks: Any, renderer: Any) -> tuple[list[Bbox], list[Bbox]]:
        """One box around the labels on either side; those of a neighbour are asked for, too."""
        place = self.axes.bbox.get_points()
        known = self._beside
        if known is None or known[0] is not ticks or not np.array_equal(known[1], place):
            sides = [
                [box for marks in ticks for box in self._boxes(marks, above, renderer)]
                for above in (False, True)
            ]
            below, above = ([Bbox.union(boxes)] if boxes else [] for boxes in sides)
            self._beside = known = ticks, place, (below, above)
        return known[2]

    def _boxes(self, marks: _Marks, above: bool, renderer: Any) -> list[Bbox]:
        """Extents of the labels; each text is measured once, wherever it stands."""
        pattern = marks.pattern.label2 if above else marks.pattern.label1
        if not pattern.get_visible():
            return []
        across = np.full(len(marks.places), float(above))
        places = (marks.places, across) if self._along == "x" else (across, marks.places)
        points = pattern.get_transform().transform(np.stack(places, axis=1))
        boxes = []
        for (x, y), place, text in zip(points, marks.places, marks.labels, strict=True):
            if text:
                key = id(pattern), text, self.axes.figure.dpi
                if key not in self._extents:
                    self._put(pattern, place, text)
                    self._extents[key] = pattern.get_window_extent(renderer).translated(-x, -y)
                boxes.append(self._extents[key].translated(x, y))
        return boxes

    def _put(self, pattern: Text, place: float, text: str) -> None:
        pattern.set_text(text)
        pattern.set(**{self._along: place})

    def draw(self, renderer: Any) -> None:
        if not self.get_visible():
            return
        axis: Any = self  # what matplotlib's stubs leave out
        renderer.open_group("matplotlib.axis", gid=self.get_gid())
        ticks = self._update_ticks()
        for marks in ticks:
            self._draw(marks, renderer)
        axis._update_label_position(renderer)
        self.label.draw(renderer)
        axis._update_offset_text_position(*self._get_ticklabel_bboxes(ticks, renderer))
        self.offsetText.set_text(self.get_major_formatter().get_offset())
        self.offsetText.draw(renderer)
        renderer.close_group("matplotlib.axis")
        self.stale = False

    def _draw(self, marks: _Marks, renderer: Any) -> None:
        pattern, places = marks.pattern, marks.places
        if pattern.gridline.get_visible():
            self._grid(pattern.gridline, places).draw(renderer)
        for line, end in ((pattern.tick1line, 0.0), (pattern.tick2line, 1.0)):
            if line.get_visible():
                across = np.full(len(places), end)
                line.set_data(*((places, across) if self._along == "x" else (across, places)))
                line.draw(renderer)
        for label in (pattern.label1, pattern.label2):
            if label.get_visible():
                for place, text in zip(places, marks.labels, strict=True):
                    if text:
                        self._put(label, place, text)
                        label.draw(renderer)

    def _grid(self, pattern: Line2D, places: Floats) -> Line2D:
        """All grid lines as one, with gaps."""
        along = np.repeat(places, 3)
        across = np.tile([0.0, 1.0, np.nan], len(places))
        line = Line2D(*((along, across) if self._along == "x" else (across, along)))
        line.update_from(pattern)
        line.set_transform(pattern.get_transform())
        line.set_figure(self.axes.figure)
        return line


class _AcrossAxis(_Few, XAxis):
    _along = "x"


class _UpAxis(_Few, YAxis):
    _along = "y"
