"""A person not yet seen above, everybody who was recorded below, on one axis in decibels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.quantities import decibel, pretty_unit
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.histogram import BINS, risk_lines, stacked
from bayeshaptic.report.numbers.cases import has_draws, raw_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.stability.cases import Case
    from bayeshaptic.study.analysis import StudyAnalysis

# How a person's bar looks: of the own recording alone, and given all people.
_ALONE = {
    "fmt": "s",
    "color": style.DATA,
    "markerfacecolor": "white",
    "markersize": 3.5,
    "linewidth": 1.0,
}
_GIVEN_ALL = {"fmt": "o", "color": style.MODEL, "markersize": 4.0, "linewidth": 1.8}
_LABEL = 30  # characters of a line in the legend
_NARROWEST_DB = 0.2  # of the axis: a population that does not differ is not to look as if it did


def draw(study: StudyAnalysis) -> Figure:
    """Histogram of a new person's limit by crossing, references beside it, and a row a user."""
    rows = max(len(study.users), 1)
    row_in = 0.26
    figure = style.new_figure(3.1 + row_in * rows)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(2.6, 0.5 + row_in * rows))
    _histogram(top, study)
    _users(bottom, study)
    unit = pretty_unit(study.users[0].limit.unit)
    bottom.set_xlabel(f"critical stiffness, dB re 1 {unit}", fontsize=style.FONT)
    return figure


def in_db(case: Case) -> NDArray[Any]:
    """Finite limits of a case in dB."""
    samples = case.limit.samples
    return 20 * np.log10(samples[np.isfinite(samples) & (samples > 0)])


def _histogram(axes: Axes, study: StudyAnalysis) -> None:
    style.panel(axes, y="probability density", grid=False)
    axes.set_yticks([])
    if not study.new_person:
        axes.text(0.5, 0.5, "no person not yet seen", transform=axes.transAxes, ha="center")
        return
    case = study.new_person[0]
    edges = _edges(study, in_db(case))
    samples = case.limit.samples
    positive = np.where(np.isfinite(samples) & (samples > 0), samples, np.nan)
    stacked(axes, case.limit, 20 * np.log10(positive), edges)
    axes.set_xlim(edges[0], edges[-1])
    axes.set_ylim(0, 1.25 * axes.get_ylim()[1])
    risk_lines(axes, case.limit, decibel, "for such a person")
    _references(axes, study)
    axes.set_title("a person not yet seen", fontsize=style.FONT, loc="left", fontweight="bold")
    style.legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.4)


def _edges(study: StudyAnalysis, values: NDArray[Any]) -> NDArray[Any]:
    """Bins over nearly all of the distribution, and over everything that is drawn beside it."""
    low, high = np.quantile(values, (0.001, 0.999))
    known = [decibel(k) for r in study.study.references if r.held for k in r.critical_stiffness]
    ends = [decibel(case.limit.quantile(p)) for case in study.users for p in (0.05, 0.95)]
    inside = [value for value in (*known, *ends) if np.isfinite(value)]
    low, high = min([low, *inside]), max([high, *inside])
    margin = max(0.04 * (high - low), 0.5 * (_NARROWEST_DB - (high - low)))
    return np.linspace(low - margin, high + margin, BINS + 1)


def _references(axes: Axes, study: StudyAnalysis) -> None:
    """Limits known from elsewhere, as triangles near the top."""
    for number, reference in enumerate(r for r in study.study.references if r.held):
        values = [decibel(k) for k in reference.critical_stiffness]
        axes.plot(
            values,
            np.full(len(values), (0.93 - 0.08 * number) * axes.get_ylim()[1]),
            "v",
            color=style.OTHER,
            markersize=5.5,
            markerfacecolor="white" if number else style.OTHER,
            label=_wrapped(reference.label),
            clip_on=False,
        )


def _wrapped(label: str) -> str:
    import textwrap

    return "\n".join(textwrap.wrap(label, _LABEL))


def _users(axes: Axes, study: StudyAnalysis) -> None:
    style.panel(axes)
    axes.grid(False, axis="y")
    alone = raw_limits(study)
    for place, case in enumerate(study.users):
        for limit in alone[case.label]:
            _bar(axes, limit, place + 0.17, _ALONE)
        if has_draws(case):
            _bar(axes, case.limit, place - 0.17, _GIVEN_ALL)
    names = [style.called(case.label.removeprefix("user ")) for case in study.users]
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(max(len(names), 1) - 0.4, -0.6)
    axes.plot([], [], "s-", color=style.DATA, markerfacecolor="white", label="own recording alone")
    axes.plot([], [], "o-", color=style.MODEL, label="given all people")
    axes.set_title("people recorded", fontsize=style.FONT, loc="left", fontweight="bold")
    style.legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.4)


def _bar(axes: Axes, limit: Any, place: float, look: Mapping[str, Any]) -> None:
    """Median and 90 % interval of a limit in dB."""
    low, middle, high = (decibel(limit.quantile(p)) for p in (0.05, 0.5, 0.95))
    if not np.isfinite([low, middle, high]).all():
        return
    axes.errorbar(
        [middle],
        [place],
        xerr=[[middle - low], [high - middle]],
        capsize=2.5,
        **look,
    )
