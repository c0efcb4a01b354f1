"""The measured frequency response with the posterior's band: gain, phase, difference, coherence."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import pretty_unit
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.band import ResponseBand, response_band
from bayeshaptic.report.figures.drawing.hover import Reading, note
from bayeshaptic.report.numbers.estimates import correction

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.recordings.response.etfe import Etfe


def draw(result: Result) -> Figure:
    """Gain, phase, measured over model, and the coherence where there is one."""
    heights = heights_of(result)
    figure = style.new_figure(0.95 * sum(heights))
    panels = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
    draw_on(panels, result)
    figure.align_ylabels(panels)
    return figure


def heights_of(result: Result) -> tuple[float, ...]:
    """Heights of the panels in inches: gain, phase, their ratio to the model, the coherence."""
    analysis = result.analysis
    coherence = (1.0,) if np.isfinite(analysis.etfe.coherence).any() else ()
    return (2.8, 2.0, *((1.7,) if analysis.sampled else ()), *coherence)


def draw_on(panels: Sequence[Axes], result: Result) -> None:
    """The same on axes that are there: gain and phase, and on further ones the rest."""
    analysis = result.analysis
    etfe = analysis.etfe
    band = response_band(analysis) if analysis.sampled else None
    force = pretty_unit(etfe.force_unit)
    unit = f"{etfe.position_unit}/({force})" if " " in force else f"{etfe.position_unit}/{force}"
    gain = style.panel(panels[0], y=f"gain, dB re 1 {unit}")
    phase = style.panel(panels[1], y="phase, degrees")
    relative, measured = etfe.relative_sd, np.unwrap(etfe.phase_deg, period=360)
    if band is not None:
        modelled = np.interp(etfe.frequency_hz, band.frequency_hz, band.phase_deg[1])
        measured = _near(etfe.phase_deg, modelled)
    # Beyond 100 % the noise has taken over, and a symmetric bar in dB says nothing.
    error = 2 * np.clip(relative / np.sqrt(2), 0.0, 1.0)
    gain_error, phase_error = 20 / np.log(10) * error, np.degrees(error)
    corrected = bool(correction(result))
    label = "measured, corrected, ± 2 sd" if corrected else "measured, ± 2 sd"
    points = _points(gain, etfe, etfe.gain_db, gain_error, label)
    points += _points(phase, etfe, measured, phase_error)
    if corrected:
        style.layer(points, "after")
    _note(gain, etfe, etfe.gain_db, gain_error, "dB", band, band.gain_db if band else ())
    _note(
        phase,
        etfe,
        measured,
        phase_error,
        "\N{DEGREE SIGN}",
        band,
        band.phase_deg if band else (),
    )
    further = list(panels[2:])
    if band is not None:
        _model(gain, phase, band)
        _before(gain, phase, result, modelled)
        if further:
            _difference(further.pop(0), etfe, band, 20 / np.log(10) * error)
    style.legend(gain)
    if further:
        coherence = style.panel(further[0], y="coherence")
        coherence.plot(etfe.frequency_hz, etfe.coherence, ".", color=style.DATA, markersize=2.5)
        coherence.set_ylim(-0.03, 1.05)
    low_hz, high_hz = etfe.frequency_hz[0], etfe.frequency_hz[-1]
    for axes in panels:
        style.frequency_axis(axes, low_hz / 1.05, high_hz * 1.05)
    panels[-1].set_xlabel("frequency, Hz", fontsize=style.FONT)


def _model(gain: Axes, phase: Axes, band: ResponseBand) -> None:
    """The posterior's response."""
    for axes, (low, middle, high) in ((gain, band.gain_db), (phase, band.phase_deg)):
        shade = axes.fill_between(
            band.frequency_hz,
            low,
            high,
            color=style.MODEL,
            alpha=0.3,
            linewidth=0,
            zorder=3,
            label="model, 90 % band of the posterior",
        )
        line = axes.plot(
            band.frequency_hz,
            middle,
            color=style.MODEL,
            linewidth=1.2,
            zorder=3,
            label="model, posterior median",
        )
        style.layer([shade, *line], "after")


def _before(gain: Axes, phase: Axes, result: Result, modelled: NDArray[Any]) -> None:
    """The model as declared, and the response as measured, where they were changed."""
    closed = result.closed
    if closed is None or not closed.effects or closed.force is not None:
        return
    base, frequency = closed.base, closed.analysis.etfe.frequency_hz
    if correction(result):
        raw = base.etfe
        near = np.interp(raw.frequency_hz, frequency, modelled)
        look: dict[str, Any] = {"color": style.PRIOR, "markersize": 2.6, "zorder": 1}
        crosses = gain.plot(raw.frequency_hz, raw.gain_db, "x", label="as measured", **look)
        crosses += phase.plot(raw.frequency_hz, _near(raw.phase_deg, near), "x", **look)
        style.layer(crosses, "before")
    declared = base.fit.response(frequency)
    dashed: dict[str, Any] = {
        "color": style.OTHER,
        "linewidth": 1.1,
        "linestyle": "--",
        "zorder": 4,
    }
    level = 20 * np.log10(np.abs(declared))
    lines = gain.plot(frequency, level, label="model as declared", **dashed)
    lines += phase.plot(frequency, _near(np.degrees(np.angle(declared)), modelled), **dashed)
    style.layer(lines, "before")


def _note(
    axes: Axes,
    etfe: Etfe,
    value: NDArray[Any],
    error: NDArray[Any],
    unit: str,
    band: ResponseBand | None,
    quantiles: tuple[NDArray[Any], ...],
) -> None:
    """What was measured at each line beside what the model says there."""
    rows = {"measured": (value, unit), "± 2 sd": (error, unit)}
    if band is not None:
        low, middle, high = (np.interp(etfe.frequency_hz, band.frequency_hz, q) for q in quantiles)
        rows |= {"model": (middle, unit), "90 %": (np.array([low, high]), unit)}
    note(axes, Reading("frequency", "Hz", etfe.frequency_hz, rows))


def _difference(axes: Axes, etfe: Etfe, band: ResponseBand, error: NDArray[Any]) -> None:
    """Measured minus model: here a band that is too narrow for the gain's axis can be seen."""
    style.panel(axes, y="measured / model,\ngain in dB")
    low, middle, high = band.gain_db
    difference = etfe.gain_db - np.interp(etfe.frequency_hz, band.frequency_hz, middle)
    _points(axes, etfe, difference, error)
    axes.fill_between(
        band.frequency_hz,
        low - middle,
        high - middle,
        color=style.MODEL,
        alpha=0.35,
        linewidth=0,
        zorder=3,
    )
    axes.axhline(0, color=style.MODEL, linewidth=1.0, zorder=3)
    # The few worst lines, of almost no signal, may run out of the panel.
    reach = 1.15 * float(np.quantile(np.abs(difference) + error, 0.97))
    axes.set_ylim(-reach, reach)


def _points(
    axes: Axes, etfe: Etfe, value: NDArray[Any], error: NDArray[Any], label: str = ""
) -> list[Any]:
    bars = axes.errorbar(
        etfe.frequency_hz,
        value,
        yerr=error,
        fmt="o",
        color=style.DATA,
        ecolor="#8c8c8c",
        markersize=2.2,
        markeredgewidth=0,
        elinewidth=0.7,
        zorder=2,
        label=label,
    )
    return bars.get_children()


def _near(phase: NDArray[Any], model: NDArray[Any]) -> NDArray[Any]:
    """The measured phase on the turn of 360 degrees on which the model lies."""
    return phase - 360 * np.round((phase - model) / 360)
