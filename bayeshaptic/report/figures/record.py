"""The raw record: force and position over time, their spectra, and the range of the motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import Scale, pretty_unit, scale
from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.recordings.recording import Recording

_BUCKETS = 400  # of the whole record, each drawn from its lowest to its highest sample
_SEGMENT = 4096
_LINES = 400


def is_shown(result: Result) -> bool:
    """Whether there is a recording to show."""
    return result.measured.recording is not None


def draw(result: Result) -> Figure:
    """Time on the left, spectrum in the middle, distribution on the right; force above position."""
    recording = result.measured.recording
    assert recording is not None
    figure = style.new_figure(3.3)
    panels = figure.subplots(2, 3, width_ratios=(1.6, 1.2, 0.7), sharex="col", sharey=False)
    force, position = recording.force, recording.position - np.mean(recording.position)
    for row, (name, values, unit, colour) in enumerate(
        (
            ("force", force, pretty_unit(recording.force_unit), style.OTHER),
            ("position", position, recording.position_unit, style.MODEL),
        )
    ):
        size = scale(float(np.abs(values).max()) or 1.0, unit)
        _over_time(panels[row, 0], recording, values * size.factor, f"{name}, {size.unit}", colour)
        _spectrum(panels[row, 1], recording, values, size, colour)
        _range(panels[row, 2], values * size.factor, colour)
    panels[1, 0].set_xlabel("time, s", fontsize=style.FONT)
    panels[1, 1].set_xlabel("frequency, Hz", fontsize=style.FONT)
    panels[1, 2].set_xlabel("samples", fontsize=style.FONT)
    figure.align_ylabels(panels[:, 0])
    return figure


def extent(values: NDArray[Any]) -> NDArray[Any]:
    """Lowest and highest sample of each of the equal parts that are drawn, shape (2, B)."""
    count = min(_BUCKETS, len(values))
    parts = np.array_split(values, count)
    return np.array([[part.min() for part in parts], [part.max() for part in parts]])


def _over_time(
    axes: Axes, recording: Recording, values: NDArray[Any], label: str, colour: str
) -> None:
    style.panel(axes, y=label)
    low, high = extent(values)
    time = np.linspace(0.0, recording.duration_s, len(low))
    axes.fill_between(time, low, high, color=colour, linewidth=0.3)


def _spectrum(
    axes: Axes, recording: Recording, values: NDArray[Any], size: Scale, colour: str
) -> None:
    from scipy.signal import welch

    segment = min(_SEGMENT, recording.samples)
    frequency, power = welch(values, 1 / recording.period_s, nperseg=segment)
    kept = np.unique(np.geomspace(1, len(frequency) - 1, _LINES).astype(int))
    density = np.sqrt(power[kept]) * size.factor
    style.panel(axes, y=f"{size.unit}/√Hz")
    axes.plot(frequency[kept], np.maximum(density, 1e-300), color=colour, linewidth=0.8)
    style.log_scale(axes.yaxis)
    axes.minorticks_off()
    style.frequency_axis(axes, float(frequency[kept[0]]), float(frequency[-1]))


def _range(axes: Axes, values: NDArray[Any], colour: str) -> None:
    style.panel(axes, grid=False)
    bins = 60
    count, edges = np.histogram(values, bins)
    axes.stairs(count, edges, orientation="horizontal", fill=True, color=colour, alpha=0.6)
    axes.set_xticks([])
