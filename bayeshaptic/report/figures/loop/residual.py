"""The residual before and after closing the loop, over frequency."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.residuals import noise_band, rms_axis
from bayeshaptic.report.numbers.octaves import third_octaves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.inference.fit import Fit

_LOOKS: tuple[dict[str, Any], ...] = (
    {"color": style.OTHER, "marker": "s", "linestyle": "--", "markerfacecolor": "none"},
    {"color": style.MODEL, "marker": "o", "linestyle": "-"},
)

_LAYERS = ("before", "after")


def draw(closed: Closed) -> Figure:
    """The rms in third octaves above, each window's score below; before and after."""
    figure = style.new_figure(4.2)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    fits = {"before" if closed.effects else "model as declared": closed.base.fit}
    if closed.effects:
        fits["after, with what was added"] = closed.analysis.fit
    style.panel(top, y="rms per third\noctave / noise")
    style.panel(bottom, y="standard deviations\nabove noise")
    bottom.axhspan(-2, 2, color="#bdbdbd", alpha=0.45, linewidth=0)
    lowest, highest = 0.5, 1.5
    for number, (fit, look) in enumerate(zip(fits.values(), _LOOKS, strict=False)):
        frequency, residual = _sorted(fit)
        bands = third_octaves(frequency, residual)
        if number == 0:
            noise_band(top, bands)
        label = list(fits)[number]
        line = top.plot(
            bands.frequency_hz, bands.rms, label=label, linewidth=1.1, markersize=4, **look
        )
        if closed.effects:
            style.layer(line, _LAYERS[number])
        lowest = min(lowest, float(bands.rms.min()))
        highest = max(highest, float(bands.rms.max()), float(bands.high.max()))
        points = _scores(bottom, fit, look)
        if closed.effects:
            style.layer(points, _LAYERS[number])
    rms_axis(top, lowest, highest)
    style.legend(top, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.1)
    everywhere = closed.base.fit.frequency_hz
    low, high = everywhere.min() / 1.05, everywhere.max() * 1.05
    style.frequency_axis(top, low, high)
    style.frequency_axis(bottom, low, high, "frequency, Hz")
    figure.align_ylabels([top, bottom])
    return figure


def _sorted(fit: Fit) -> tuple[NDArray[Any], NDArray[Any]]:
    order = np.argsort(fit.frequency_hz)
    return fit.frequency_hz[order], fit.residual[order]


def _scores(axes: Axes, fit: Fit, look: dict[str, Any]) -> list[Any]:
    """A point a window; those of a large misfit are pressed together."""
    from bayeshaptic.diagnosis.residuals.residual import window_scores

    if fit.windows is None:
        return []
    centre = fit.windows.frequency_hz.mean(axis=1)
    points = axes.plot(centre, window_scores(fit), **(look | {"linestyle": "none"}), markersize=2.6)
    low, high = axes.get_ylim()
    if high > 12:
        axes.set_yscale("symlog", linthresh=4.0, linscale=1.0)
        tens = [t for t in (10.0, 30.0, 100.0, 300.0) if t < 1.1 * high]
        style.fixed_ticks(axes.yaxis, [-2, 0, 2, *tens])
    return points
