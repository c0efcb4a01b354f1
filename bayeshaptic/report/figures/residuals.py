"""What the model leaves unexplained, in units of the noise."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.octaves import BandResidual, third_octaves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(result: Result) -> Figure:
    """Real and imaginary part over frequency above, the rms in third octaves below."""
    return style.two_panels(4.2, lambda panels: draw_on(panels, result))


def draw_on(panels: Sequence[Axes], result: Result) -> None:
    """The same on two axes that are there."""
    top, bottom = panels
    analysis = result.analysis
    order = np.argsort(analysis.fit.frequency_hz)
    frequency, residual = analysis.fit.frequency_hz[order], analysis.fit.residual[order]
    style.panel(top, y="residual / sd of the noise")
    top.axhspan(-2, 2, color="#bdbdbd", alpha=0.45, linewidth=0, label="95 % of pure noise")
    parts = np.sqrt(2) * np.stack([residual.real, residual.imag])
    for part, marker, name, colour in zip(
        parts, ("o", "^"), ("real part", "imaginary part"), (style.MODEL, style.OTHER), strict=True
    ):
        top.plot(
            frequency,
            part,
            marker,
            color=colour,
            markersize=2.8,
            markeredgewidth=0.5,
            markerfacecolor=colour if marker == "o" else "none",
            label=name,
        )
    worst = max(float(np.nanmax(np.abs(parts))), 4.0)
    if worst > 10:
        _symlog(top, worst)
    top.set_ylim(-1.25 * worst, 1.25 * worst)
    _legend_above(top)
    style.panel(bottom, y="rms per third\noctave / noise")
    bands = third_octaves(frequency, residual)
    noise_band(bottom, bands)
    bottom.plot(
        bands.frequency_hz,
        bands.rms,
        "s-",
        color=style.DATA,
        markersize=3,
        linewidth=0.9,
        label="measured",
    )
    rms_axis(
        bottom,
        float(min(bands.rms.min(), bands.low.min())),
        float(max(bands.rms.max(), bands.high.max())),
    )
    _legend_above(bottom)
    style.frequency_axis(top, frequency[0] / 1.05, frequency[-1] * 1.05)
    style.frequency_axis(bottom, frequency[0] / 1.05, frequency[-1] * 1.05, "frequency, Hz")


def _legend_above(axes: Axes) -> None:
    """Outside of the panel: inside it would cover points wherever it stood."""
    style.legend(axes, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.1)


def _symlog(axes: Axes, worst: float) -> None:
    """Linear within four sd, logarithmic beyond, with plain numbers on it."""
    axes.set_yscale("symlog", linthresh=4.0, linscale=1.0)
    tens = [10.0**k for k in range(1, int(np.log10(1.25 * worst)) + 1)]
    style.fixed_ticks(axes.yaxis, [*(-t for t in reversed(tens)), -2, 0, 2, *tens])


def noise_band(axes: Axes, bands: BandResidual) -> None:
    """What 99 % of pure noise stays within, in grey."""
    axes.fill_between(
        bands.frequency_hz,
        bands.low,
        bands.high,
        color="#bdbdbd",
        alpha=0.45,
        linewidth=0,
        label="99 % of pure noise",
    )


def rms_axis(axes: Axes, lowest: float, highest: float) -> None:
    """From zero; logarithmic where the residual is many times the noise."""
    if highest <= 6:
        axes.set_ylim(0, 1.1 * highest)
        return
    room = 100  # times, from which on numbers between the powers of ten would overlap
    style.log_scale(axes.yaxis, (1, 2, 5) if highest < room * lowest else (1,))
    axes.set_ylim(0.9 * lowest, 1.3 * highest)
