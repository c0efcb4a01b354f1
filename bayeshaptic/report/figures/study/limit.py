"""Every case that a device must stay stable in, and the limit over all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.quantities import decibel, percent, pretty_unit
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.cases import is_free
from bayeshaptic.stability.cases import CONFIGURATION, FREE, HELD, NEW_PERSON

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.stability.cases import Case
    from bayeshaptic.study.analysis import StudyAnalysis

LOOKS = {
    FREE: (style.OTHER, "s"),
    HELD: (style.MODEL, "o"),
    NEW_PERSON: (style.CYCLE[2], "D"),
    CONFIGURATION: (style.CYCLE[3], "^"),
}
_ORDER = (FREE, HELD, NEW_PERSON, CONFIGURATION)
_PREDICTED = "(predicted)"  # as labels of configurations that were not recorded have it


def draw(study: StudyAnalysis) -> Figure:
    """A row a case with median, 50 and 90 % interval; the last row is their minimum."""
    assert study.limit is not None
    shares = {found.case: found.probability for found in study.limit.binding}
    cases = shown_cases(study)
    row_in = 0.2
    figure = style.new_figure(0.75 + row_in * (len(cases) + 1))
    spans = _spans(study, cases)
    panels = figure.subplots(1, len(spans), sharey=True, squeeze=False)[0]
    for axes, (low, high) in zip(panels, spans, strict=True):
        for place, case in enumerate(cases):
            colour, marker = LOOKS.get(case.group, (style.DATA, "o"))
            _row(axes, case.limit, place, colour, marker)
        _row(axes, study.limit, len(cases), style.DATA, "P", 2.2)
        axes.axhline(len(cases) - 0.5, color=style.GRID, linewidth=1.0)
        axes.set_ylim(len(cases) + 0.6, -0.6)
        style.panel(axes)
        axes.grid(False, axis="y")
        axes.set_xlim(low, high)
    named = [(style.called(case.label), shares.get(case.label, 0.0)) for case in cases]
    labels = [f"{name}  ({percent(share)})" for name, share in named]
    panels[0].set_yticks(range(len(cases) + 1), [*labels, "the lowest of all"])
    unit = pretty_unit(study.limit.unit)
    figure.supxlabel(f"critical stiffness, dB re 1 {unit}", fontsize=style.FONT)
    return figure


def _spans(study: StudyAnalysis, cases: tuple[Case, ...]) -> list[tuple[float, float]]:
    """Ends of the axis; of two axes where the cases stand far apart, free and held mostly."""
    assert study.limit is not None
    limits: list[Any] = [*(case.limit for case in cases), study.limit]
    ends = [tuple(decibel(limit.quantile(p)) for p in (0.05, 0.95)) for limit in limits]
    ends = sorted(pair for pair in ends if np.isfinite(pair).all())
    if not ends:
        return [(0.0, 1.0)]
    parts = [[ends[0][0], ends[0][1]]]
    far_db = 6.0
    for low, high in ends[1:]:
        if low - parts[-1][1] > far_db and len(parts) < 2:
            parts.append([low, high])
        parts[-1][1] = max(parts[-1][1], high)
    margins = [max(0.06 * (high - low), 0.1) for low, high in parts]
    return [(p[0] - m, p[1] + m) for p, m in zip(parts, margins, strict=True)]


def shown_cases(study: StudyAnalysis) -> tuple[Case, ...]:
    """By group; of the configurations those that may bind or were recorded with nobody holding it.

    Of too many cases those that bind most. The configurations have a figure of their own.
    """
    assert study.limit is not None
    shares = {found.case: found.probability for found in study.limit.binding}
    seen = 0.02  # probability to set the limit
    kept = [
        case
        for case in study.cases
        if case.group != CONFIGURATION
        or shares.get(case.label, 0.0) > seen
        or (is_free(case.label, case.group) and _PREDICTED not in case.label)
    ]
    most = 24
    kept = sorted(kept, key=lambda case: -shares.get(case.label, 0.0))[:most]
    return tuple(case for group in _ORDER for case in kept if case.group == group)


def _row(
    axes: Axes, limit: Any, place: float, colour: str, marker: str, width: float = 1.4
) -> None:
    ends = [decibel(limit.quantile(p)) for p in (0.05, 0.25, 0.5, 0.75, 0.95)]
    if not np.isfinite(ends).all():
        return
    # Caps would reach beyond the ends, and stand out behind the marker where a limit is well known.
    bar: dict[str, Any] = {"color": colour, "solid_capstyle": "butt"}
    axes.plot([ends[0], ends[4]], [place, place], linewidth=width, **bar)
    axes.plot([ends[1], ends[3]], [place, place], linewidth=2.8 * width, **bar)
    # A wide edge would leave nothing of a small marker.
    edge: dict[str, Any] = {"markeredgecolor": "white", "markeredgewidth": 0.4}
    axes.plot([ends[2]], [place], marker, color=colour, markersize=5.5, **edge)
