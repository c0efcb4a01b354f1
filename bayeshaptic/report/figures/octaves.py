"""The residual in third octaves beside what pure noise would give: what figures of it share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bayeshaptic.report.numbers.octaves import BandResidual


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
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if highest <= 6:
        axes.set_ylim(0, 1.1 * highest)
        return
    axes.set_yscale("log")
    axes.set_ylim(0.9 * lowest, 1.3 * highest)
    axes.yaxis.set_major_locator(LogLocator(10, subs=(1, 2, 5)))
    axes.yaxis.set_major_formatter(FuncFormatter(style.plain))
    axes.yaxis.set_minor_formatter(NullFormatter())
