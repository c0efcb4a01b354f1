"""The critical stiffness along a configuration coordinate, free and held."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.quantities import decibel, pretty_unit
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.bands import Band, band_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.study.analysis import StudyAnalysis
    from bayeshaptic.study.configuration_limits import ConfigurationLimits

_LOOKS = {False: (style.OTHER, "s", "--"), True: (style.MODEL, "o", "-")}


def draw(study: StudyAnalysis) -> Figure:
    """A band for each of free and held, in one panel, or in two where they are far apart."""
    assert study.limit is not None
    bands = [(one, band_of(one)) for one in study.configurations]
    far_db = 8.0  # between free and held, to have a panel each
    apart = len(bands) > 1 and _gap([band for _, band in bands]) > far_db
    figure = style.new_figure(3.6 if apart else 2.9)
    count = len(bands) if apart else 1
    panels = figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0]
    order = sorted(bands, key=lambda pair: not pair[0].held)  # the higher one above, as it is
    for number, (one, band) in enumerate(order):
        _draw(panels[number if apart else 0], study, one, band)
    unit = pretty_unit(study.limit.unit)
    for axes in panels:
        style.panel(axes, y=f"K_CR, dB re 1 {unit}")
        style.legend(axes, loc="upper left", bbox_to_anchor=(1.0, 1.0), borderaxespad=0.4)
    panels[-1].set_xlabel("configuration", fontsize=style.FONT)
    return figure


def _gap(bands: list[Band]) -> float:
    """The empty space between the bands in dB."""
    ends = sorted((decibel(band.low.min()), decibel(band.high.max())) for band in bands)
    return max(later[0] - earlier[1] for earlier, later in zip(ends, ends[1:], strict=False))


def _draw(axes: Axes, study: StudyAnalysis, one: ConfigurationLimits, band: Band) -> None:
    colour, marker, line = _LOOKS[one.held]
    who = "held" if one.held else "nobody holds it"
    with np.errstate(divide="ignore"):
        low, middle, high = (20 * np.log10(v) for v in (band.low, band.middle, band.high))
    axes.fill_between(band.coordinates, low, high, color=colour, alpha=0.25, linewidth=0)
    axes.plot(band.coordinates, middle, line, color=colour, label=f"{who}: median and 90 %")
    for edge in (low, high):
        axes.plot(band.coordinates, edge, color=colour, linewidth=0.5)
    labelled = False
    for found in study.recordings:
        place = found.entry.configuration
        same = (found.entry.user is not None) == one.held
        if found.analysis is None or not same or not isinstance(place, int | float):
            continue
        ends = [decibel(found.analysis.limit.quantile(p)) for p in (0.05, 0.5, 0.95)]
        axes.errorbar(
            [place],
            [ends[1]],
            yerr=[[ends[1] - ends[0]], [ends[2] - ends[1]]],
            fmt=marker,
            color=style.DATA,
            markerfacecolor="white",
            markersize=3.8,
            linewidth=1.0,
            capsize=2.5,
            label=None if labelled else f"recordings, {who}",
        )
        labelled = True
