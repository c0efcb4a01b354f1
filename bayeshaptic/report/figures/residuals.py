"""What the model leaves unexplained, in units of the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


BAND_OCTAVES = 1 / 3
EXPECTED = (0.005, 0.995)


@dataclass(frozen=True)
class BandResidual:
    """Root mean square of the normalised residual in third octaves, arrays of shape (K,).

    1 is the noise; `low` to `high` holds 99 % of what pure noise gives with that many points.
    """

    frequency_hz: NDArray[Any]
    rms: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]


def third_octaves(frequency_hz: NDArray[Any], residual: NDArray[Any]) -> BandResidual:
    """The complex residual of shape (L,), normalised to E|r|^2 = 1, gathered in third octaves."""
    octave = np.log2(frequency_hz / frequency_hz[0])
    index = np.minimum(octave / BAND_OCTAVES, octave[-1] / BAND_OCTAVES - 1e-9).astype(int)
    _, index = np.unique(index, return_inverse=True)
    count = np.bincount(index)
    power = np.bincount(index, np.abs(residual) ** 2) / count
    centre = np.exp(np.bincount(index, np.log(frequency_hz)) / count)
    low, high = (np.sqrt(chi2.ppf(p, 2 * count) / (2 * count)) for p in EXPECTED)
    return BandResidual(centre, np.sqrt(power), low, high)


def draw(result: Result) -> Figure:
    """Real and imaginary part over frequency above, the rms in third octaves below."""
    figure = style.new_figure(4.2)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    draw_on(panels, result)
    figure.align_ylabels(panels)
    return figure


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
    bottom.fill_between(
        bands.frequency_hz,
        bands.low,
        bands.high,
        color="#bdbdbd",
        alpha=0.45,
        linewidth=0,
        label="99 % of pure noise",
    )
    bottom.plot(
        bands.frequency_hz,
        bands.rms,
        "s-",
        color=style.DATA,
        markersize=3,
        linewidth=0.9,
        label="measured",
    )
    _rms_axis(bottom, bands)
    _legend_above(bottom)
    style.frequency_axis(top, frequency[0] / 1.05, frequency[-1] * 1.05)
    style.frequency_axis(bottom, frequency[0] / 1.05, frequency[-1] * 1.05, "frequency, Hz")


def _legend_above(axes: Axes) -> None:
    """Outside of the panel: inside it would cover points wherever it stood."""
    style.legend(axes, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.1)


def _symlog(axes: Axes, worst: float) -> None:
    """Linear within four sd, logarithmic beyond, with plain numbers on it."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    axes.set_yscale("symlog", linthresh=4.0, linscale=1.0)
    tens = [10.0**k for k in range(1, int(np.log10(1.25 * worst)) + 1)]
    axes.yaxis.set_major_locator(FixedLocator([*(-t for t in reversed(tens)), -2, 0, 2, *tens]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(FuncFormatter(style.plain))


def _rms_axis(axes: Axes, bands: BandResidual) -> None:
    highest = max(float(bands.rms.max()), float(bands.high.max()))
    if highest > 6:
        from matplotlib.ticker import FuncFormatter

        axes.set_yscale("log")
        axes.set_ylim(0.9 * min(bands.rms.min(), bands.low.min()), highest * 1.3)
        axes.yaxis.set_major_formatter(FuncFormatter(style.plain))
    else:
        axes.set_ylim(0, highest * 1.1)
