"""Where the limit comes from: 1/|G| is the critical stiffness where the phase is -180 degrees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import Scale, quantity, scale
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.band import thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.recordings.response.etfe import Etfe

CURVES = 60
POINTS = 700
SHOWN = 5
MARKERS = "ovDs^"
LINEAR_DEG = 10.0


def draw(result: Result) -> Figure:
    """Stiffness above, phase from -180 degrees below, up to the Nyquist frequency."""
    return style.two_panels(4.4, lambda panels: draw_on(panels, result))


def draw_on(panels: Sequence[Axes], result: Result) -> None:
    """The same on two axes that are there."""
    top, bottom = panels
    analysis = result.analysis
    etfe, limit = analysis.etfe, analysis.limit
    low_hz, half = float(etfe.frequency_hz[0]), 0.5 / etfe.period_s
    found = [(hz, k) for hz, k in _at_median(analysis) if hz > 0.02 * low_hz]
    start = min([low_hz, *(hz for hz, _ in found)]) / 1.3
    frequency = np.unique(np.r_[np.geomspace(start, half, POINTS), etfe.frequency_hz])
    response = analysis.model.response(thinned(analysis.posterior.draws, CURVES), frequency)
    seen = etfe.value
    if etfe.of_measured_force:
        seen = seen / analysis.fit.sensor(etfe.frequency_hz)
    row = scale(limit.quantile(0.5), limit.unit)
    style.panel(top, y=f"1/|G|, {row.unit}")
    style.panel(bottom, y="phase + 180°, degrees")
    _curves(top, frequency, row.factor / np.abs(response))
    _curves(bottom, frequency, _unbroken(np.degrees(np.angle(-response))))
    top.plot(
        etfe.frequency_hz,
        row.factor / np.abs(seen),
        ".",
        color=style.DATA,
        markersize=3,
        label="measured" if seen is etfe.value else "measured, lag taken off",
    )
    bottom.plot(etfe.frequency_hz, np.degrees(np.angle(-seen)), ".", color=style.DATA, markersize=3)
    _marks(top, bottom, analysis, row, found)
    for axes in (top, bottom):
        style.frequency_axis(axes, start, half * 1.02)
        axes.axvspan(etfe.frequency_hz[-1], half * 1.02, color="#f0f0f0", zorder=0, linewidth=0)
        if start < low_hz:
            axes.axvspan(start, low_hz, color="#f0f0f0", zorder=0, linewidth=0)
    style.log_scale(top.yaxis)
    top.set_ylim(*_stiffness_range(etfe, [k for _, k in found], row))
    bottom.set_yscale("symlog", linthresh=LINEAR_DEG, linscale=1.2)
    _phase_ticks(bottom)
    bottom.set_xlabel("frequency, Hz (grey: not measured)", fontsize=style.FONT)
    style.legend(top, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def _at_median(analysis: Analysis) -> list[tuple[float, float]]:
    """(frequency, stiffness) of the lowest crossings at the posterior's median parameters."""
    from bayeshaptic.stability.crossings import find_crossings

    middle = np.median(analysis.posterior.draws, axis=0)
    found = find_crossings(analysis.model.system(middle), analysis.etfe.period_s)
    pairs = zip(found.frequency_hz[0], found.stiffness[0], strict=True)
    return [(float(hz), float(k)) for hz, k in pairs if np.isfinite(k)][:SHOWN]


def _stiffness_range(etfe: Etfe, critical: list[float], row: Scale) -> tuple[float, float]:
    """All that was measured and all crossings; towards Nyquist 1/|G| may grow without bound."""
    shown = np.r_[1 / np.abs(etfe.value), critical] * row.factor
    return float(shown.min()) / 2, float(shown.max()) * 3


def _curves(axes: Axes, frequency: NDArray[Any], values: NDArray[Any]) -> None:
    """All draws as one artist, in pixels: as strokes they are too much for a page."""
    from matplotlib.collections import LineCollection

    curves = LineCollection(
        [np.column_stack([frequency, curve]) for curve in values],
        colors=style.MODEL,
        linewidths=0.6,
        alpha=0.3,
        label="draws of the posterior",
        rasterized=True,
    )
    axes.add_collection(curves, autolim=False)


def _unbroken(phase_deg: NDArray[Any]) -> NDArray[Any]:
    """With gaps where the phase wraps, so that no line is drawn through the panel."""
    phase_deg = phase_deg.copy()
    phase_deg[:, 1:][np.abs(np.diff(phase_deg, axis=1)) > 180] = np.nan
    return phase_deg


def _marks(
    top: Axes, bottom: Axes, analysis: Analysis, row: Scale, found: list[tuple[float, float]]
) -> None:
    unit = analysis.limit.unit
    middle = analysis.limit.quantile(0.5)
    if np.isfinite(middle) and middle > 0:
        top.axhline(
            middle * row.factor,
            color=style.OTHER,
            linewidth=1.0,
            linestyle="--",
            label=f"median limit {quantity(middle, unit)}",
        )
    bottom.axhline(0, color=style.DATA, linewidth=0.7)
    for number, (hz, stiffness) in enumerate(found):
        look: dict[str, Any] = {
            "color": "white",
            "markeredgecolor": style.CYCLE[number],
            "markeredgewidth": 1.5,
            "markersize": 6.5,
            "zorder": 5,
        }
        label = f"{quantity(hz, 'Hz')}: {quantity(stiffness, unit)}"
        top.plot([hz], [stiffness * row.factor], MARKERS[number], label=label, **look)
        bottom.plot([hz], [0], MARKERS[number], **look)


def _phase_ticks(axes: Axes) -> None:
    axes.set_ylim(-185, 185)
    style.fixed_ticks(axes.yaxis, [-180, -60, -LINEAR_DEG, 0, LINEAR_DEG, 60, 180])
