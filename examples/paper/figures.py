"""The paper's figures redrawn, with posterior bands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models import build_model
from bayeshaptic.report.figures import style
from bayeshaptic.stability import find_crossings
from bayeshaptic.types import Floats

from .identification import Identified
from .published import TITLES, decibel
from .relays import RelayRun

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


DRAWS = 300
POINTS = 900
COLOURS = {"rigid": "#009e73", "free": "#d55e00", "grasped": "#0072b2"}
DASHES = {"rigid": ":", "free": "--", "grasped": "-"}
NAMES = {"rigid": "rigid", "free": "free", "grasped": "held"}
UNITS = {"phantom": "N m/rad", "lhifam": "N/m"}


def bode(pair: Sequence[Identified]) -> Figure:
    """Gain and phase of a device, free and held: experiment, published model, posterior."""
    figure = style.new_figure(5.6)
    panels = figure.subplots(3, 2, sharex="col", sharey="row", height_ratios=(3, 2, 1.5))
    for column, (axes, found) in enumerate(zip(panels.T, pair, strict=True)):
        _bode_column(axes[0], axes[1], axes[2], found)
        style.panel(axes[0], title=TITLES[found.case])
        style.panel(axes[1])
        style.panel(axes[2])
        low, high = found.etfe.band_hz
        for panel in axes:
            style.frequency_axis(panel, low, high)
        axes[2].set_xlabel("frequency, Hz", fontsize=style.FONT)
        if column == 0:
            unit = UNITS[found.case[0]].replace("N m/rad", "rad/(N m)").replace("N/m", "m/N")
            axes[0].set_ylabel(f"gain, dB re 1 {unit}", fontsize=style.FONT)
            axes[1].set_ylabel("phase, degrees", fontsize=style.FONT)
            axes[2].set_ylabel("gain over\npublished, dB", fontsize=style.FONT)
            axes[2].set_ylim(-1, 1)
            style.legend(axes[0], loc="lower left")
    figure.align_ylabels(panels[:, 0])
    return figure


def _bode_column(top: Axes, bottom: Axes, difference: Axes, found: Identified) -> None:
    etfe, model = found.etfe, found.posterior.model
    frequency = np.geomspace(*etfe.band_hz, POINTS)
    every = max(len(found.posterior.draws) // DRAWS, 1)
    draws = model.response(found.posterior.draws[::every], frequency)
    truth = build_model(found.case[1], found.case[0])
    published = truth.response(truth.values, frequency)
    phase = _phase(published)
    gain = decibel(np.abs(published))
    at_points = decibel(np.abs(truth.response(truth.values, etfe.frequency_hz)))
    for axes, points, band, line in (
        (top, etfe.gain_db, decibel(np.abs(draws)), gain),
        (difference, etfe.gain_db - at_points, decibel(np.abs(draws)) - gain, 0 * gain),
        (bottom, _phase(etfe.value), phase + np.degrees(np.angle(draws / published)), phase),
    ):
        if axes is bottom:
            at = np.interp(etfe.frequency_hz, frequency, phase)
            points = points - 360 * np.round((points - at) / 360)
        axes.plot(
            etfe.frequency_hz,
            points,
            ".",
            color="#8c8c8c",
            markersize=2.5,
            label="experiment (bench)",
        )
        low, high = np.quantile(band, [0.025, 0.975], axis=0)
        axes.fill_between(
            frequency,
            low,
            high,
            color=style.MODEL,
            alpha=0.45,
            linewidth=0.6,
            label="posterior, 95 % band",
        )
        axes.plot(frequency, line, "--", color=style.DATA, linewidth=0.8, label="published model")


def _phase(response: NDArray[np.complex128]) -> Floats:
    """In degrees, between -360 and 0."""
    return np.degrees(np.angle(-response)) - 180


def margins(identified: Sequence[Identified]) -> Figure:
    """1/|G| and the distance to -180 degrees of the three models of one device, with crossings."""
    device = identified[0].case[0]
    figure = style.new_figure(4.8)
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    style.panel(top, y=f"1/|G|, dB re 1 {UNITS[device]}")
    style.panel(bottom, y="phase + 180°, degrees")
    frequency = np.geomspace(2.0, 300.0, POINTS)
    bands = {found.case[1]: found for found in identified}
    for name in ("rigid", "free", "grasped"):
        model = build_model(name, device)
        response = model.response(model.values, frequency)
        look = {"color": COLOURS[name], "linestyle": DASHES[name], "linewidth": 1.2}
        top.plot(frequency, -decibel(np.abs(response)), label=f"{NAMES[name]} model", **look)
        bottom.plot(frequency, _unbroken(response), **look)
        if name in bands:
            _band(top, bottom, bands[name], frequency, COLOURS[name])
        found = find_crossings(model.system(model.values), model.period_s or 1e-3)
        for hertz, stiffness in zip(found.frequency_hz[0], found.stiffness[0], strict=True):
            if 2.0 < hertz < 300.0:
                binds = stiffness == found.stiffness[0, 0]
                _mark(top, bottom, hertz, float(decibel(stiffness)), name, binds)
                if binds:
                    _name(top, hertz, float(decibel(stiffness)), name, device, bands.get(name))
    for axes in (top, bottom):
        style.frequency_axis(axes, 2.0, 300.0)
    bottom.axhline(0, color=style.DATA, linewidth=0.7)
    bottom.set_ylim(-60, 60)
    bottom.set_xlabel("frequency, Hz", fontsize=style.FONT)
    style.legend(top, loc="upper left")
    figure.align_ylabels([top, bottom])
    return figure


def _band(top: Axes, bottom: Axes, found: Identified, frequency: Floats, colour: str) -> None:
    every = max(len(found.posterior.draws) // DRAWS, 1)
    draws = found.posterior.model.response(found.posterior.draws[::every], frequency)
    for axes, values in ((top, -decibel(np.abs(draws))), (bottom, np.degrees(np.angle(-draws)))):
        low, high = np.quantile(values, [0.025, 0.975], axis=0)
        axes.fill_between(frequency, low, high, color=colour, alpha=0.25, linewidth=0)


def _mark(top: Axes, bottom: Axes, hertz: float, gain: float, name: str, binds: bool) -> None:
    """A crossing: full where it binds."""
    colour = COLOURS[name]
    face = colour if binds else "white"
    for axes, height in ((top, gain), (bottom, 0.0)):
        axes.plot(hertz, height, "o", color=colour, markerfacecolor=face, markersize=5, zorder=5)


def _name(
    axes: Axes, hertz: float, gain: float, name: str, device: str, found: Identified | None
) -> None:
    """The binding crossing's gain margin and frequency, and the posterior's."""
    above = name == ("rigid" if device == "phantom" else "free")
    text = f"{gain:.2f} dB, {hertz:.2f} Hz"
    if found is not None:
        low, high = found.limit.db([0.05, 0.95])
        text += f"\nposterior {low:.2f} to {high:.2f} dB"
    axes.annotate(
        text,
        (hertz, gain),
        xytext=(-8, 34 if device == "phantom" else 12)
        if above
        else ((-2, -24) if hertz > 90 else (8, -14)),
        textcoords="offset points",
        fontsize=style.SMALL,
        color=COLOURS[name],
        ha="right" if above or hertz > 90 else "left",
        va="bottom" if above else "top",
        bbox={"facecolor": "white", "alpha": 0.85, "linewidth": 0, "pad": 1.0},
    )


def _unbroken(response: NDArray[np.complex128]) -> Floats:
    """Phase from -180 degrees, with the jumps of a turn left out of the line."""
    phase = np.degrees(np.angle(-response))
    phase[1:][np.abs(np.diff(phase)) > 180] = np.nan
    return phase


def oscillation(run: RelayRun) -> Figure:
    """Force and position of a relay experiment, their power spectral densities, and 1/|G|."""
    from scipy.signal import welch

    figure = style.new_figure(4.6)
    panels = figure.subplots(2, 2)
    recording, measured = run.recording, run.measured
    device = run.case[0]
    rotational = recording.position_unit == "rad"
    scale, unit = (1e3, "mrad") if rotational else (1e6, "\N{MICRO SIGN}m")
    time = recording.period_s * np.arange(recording.samples)
    shown = (time > 10.0) & (time < 10.1)
    milliseconds = 1e3 * (time[shown] - 10.0)
    force_unit = "N m" if rotational else "N"
    force = style.panel(panels[0, 0], y=f"force, {force_unit}", title=f"{TITLES[run.case]}: relay")
    force.step(milliseconds, recording.force[shown], where="post", color=style.DATA, linewidth=0.8)
    position = style.panel(panels[1, 0], "time, ms", f"position, {unit}")
    motion = scale * (recording.position[shown] - np.mean(recording.position[shown]))
    position.plot(milliseconds, motion, ".-", color=style.MODEL, markersize=2.5, linewidth=0.7)
    spectrum = style.panel(panels[0, 1], y="power spectral density", title="steady state")
    steady = time > measured.steady_s[0]
    for signal, colour, label, dash in (
        (recording.force, style.DATA, "force", "-"),
        (recording.position, style.MODEL, "position", "--"),
    ):
        frequency, density = welch(signal[steady], 1 / recording.period_s, nperseg=4096)
        spectrum.semilogy(
            frequency[1:],
            density[1:] / density[1:].max(),
            dash,
            color=colour,
            linewidth=0.8,
            label=label,
        )
    spectrum.set_xlim(0, 4.5 * measured.frequency_hz)
    spectrum.set_ylim(1e-9, 3)
    style.legend(spectrum, loc="upper right")
    _relay_on_response(panels[1, 1], run, UNITS[device])
    figure.align_ylabels(panels[:, 0])
    return figure


def _relay_on_response(axes: Axes, run: RelayRun, unit: str) -> None:
    model, measured = build_model(run.case[1], run.case[0]), run.measured
    frequency = measured.frequency_hz * np.linspace(0.88, 1.12, 200)
    gain = -decibel(np.abs(model.response(model.values, frequency)))
    style.panel(axes, "frequency, Hz", f"stiffness, dB re 1 {unit}")
    axes.plot(frequency, gain, color="#8c8c8c", linewidth=1.0, label="1/|G| of the model")
    axes.errorbar(
        measured.frequency_hz,
        measured.gain_margin_db,
        xerr=2 * measured.frequency_sd_hz,
        yerr=2 * measured.gain_margin_sd_db,
        fmt="o",
        color=style.DATA,
        markersize=4,
        label=f"relay, {measured.phase_deg:+.1f}° from −180°",
    )
    if measured.critical_db is not None and measured.crossing_hz is not None:
        axes.errorbar(
            measured.crossing_hz,
            measured.critical_db,
            yerr=2 * (measured.critical_sd_db or 0.0),
            fmt="s",
            color=style.MODEL,
            markersize=4,
            label="followed to −180°",
        )
    axes.plot(
        run.check.settled_hz,
        decibel(run.check.settled_stiffness),
        "x",
        color=style.OTHER,
        markersize=7,
        label="crossing of the model",
    )
    style.legend(axes, loc="upper left")
