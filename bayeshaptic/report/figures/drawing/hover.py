"""Values under the pointer: what a page's script reads out beside a figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from bayeshaptic.types import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

DIGITS = 4


@dataclass(frozen=True)
class Reading:
    """What stands at each place of a panel, in the units of its axes.

    Attributes
    ----------
    name, unit : str
        Of the horizontal axis.
    places : ndarray, shape (K,)
        Ascending.
    rows : mapping of str to (values, unit)
        What is read out at each place: one number, arrays of shape (K,), or the two ends of an
        interval, shape (2, K).
    risks : sequence of float
        Of a panel whose vertical axis is a stiffness: the risks whose boundaries are known,
        ascending.
    boundaries : ndarray, shape (R, K)
        The stiffness of each risk.
    """

    name: str
    unit: str
    places: Floats
    rows: Mapping[str, tuple[Floats, str]]
    risks: Sequence[float] = ()
    boundaries: Floats | None = None


_NOTED: WeakKeyDictionary[Axes, Reading] = WeakKeyDictionary()


def note(axes: Axes, reading: Reading) -> None:
    """Let a page read out values over this panel."""
    _NOTED[axes] = reading


def panels(figure: Figure) -> list[dict[str, Any]]:
    """The panels of a figure that is laid out, as data for the page's script.

    A panel's ``box`` is left, top, width and height as shares of the figure; ``x`` and ``y`` are
    the ends of its axes, ``log`` whether each is logarithmic.
    """
    found = []
    for axes in figure.axes:
        reading = _NOTED.get(axes)
        if reading is None:
            continue
        box = axes.get_position()
        panel: dict[str, Any] = {
            "box": _short([box.x0, 1 - box.y1, box.width, box.height]),
            "x": _short(axes.get_xlim()),
            "y": _short(axes.get_ylim()),
            "log": [axes.get_xscale() == "log", axes.get_yscale() == "log"],
            "name": reading.name,
            "unit": reading.unit,
            "at": _short(reading.places),
            "rows": [[name, unit, _rows(v)] for name, (v, unit) in reading.rows.items()],
        }
        if reading.boundaries is not None:
            panel["risks"] = list(reading.risks)
            panel["boundaries"] = [_short(row) for row in reading.boundaries]
        found.append(panel)
    return found


def _rows(values: Floats) -> list[list[float | None]]:
    return [_short(row) for row in np.atleast_2d(values)]


def _short(values: Any) -> list[float | None]:
    """Few digits: they are read, not computed with."""
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in map(float, values)]
