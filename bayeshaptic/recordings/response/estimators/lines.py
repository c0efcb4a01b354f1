"""The DFT lines of a whole record, and a band of them cut into windows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.local_polynomial import window_edges
from bayeshaptic.recordings.response.spectra import REPEATS_TO, RandomSpectra
from bayeshaptic.recordings.response.window_reference import unit_mass
from bayeshaptic.recordings.signals.rows.timing import unusual_period

FEWEST_WINDOWS = 8
# The lowest window then spans a factor 2.14: for 30 s and 24 lines, 0.7 to 1.5 Hz.
LOW_END_WINDOWS = 0.875
# What to advise: 12 lines are then 12 Hz, and limits below 20 Hz are common.
SHORTEST_S = 1.0


@dataclass(frozen=True)
class Lines:
    """All lines of a recording, transformed once for every band that is looked at.

    Attributes
    ----------
    recording : Recording
    frequency_hz : ndarray, shape (L,)
    force, position : complex ndarray, shape (L,)
        DFT over sqrt(N), without a taper; a straight line taken off the position.
    """

    recording: Recording
    frequency_hz: NDArray[Any] = field(repr=False)
    force: NDArray[Any] = field(repr=False)
    position: NDArray[Any] = field(repr=False)

    @classmethod
    def of(cls, recording: Recording) -> Lines:
        """Those of a recording in one piece."""
        scale = 1 / np.sqrt(recording.samples)
        return cls(
            recording,
            np.fft.rfftfreq(recording.samples, recording.period_s),
            np.fft.rfft(recording.force - recording.force.mean()) * scale,
            np.fft.rfft(_detrended(recording.position)) * scale,
        )

    @property
    def rounding(self) -> float:
        """What double precision makes of the largest position."""
        return float(np.finfo(float).eps * np.max(np.abs(self.recording.position)))

    def cut(
        self, band_hz: tuple[float, float], minimum: int, what: str = "the band is"
    ) -> RandomSpectra:
        """The lines of a band in windows of at least `minimum`.

        Raises
        ------
        InputError
            When there are too few lines for `FEWEST_WINDOWS` windows.
        """
        # The last line of an even record, at the Nyquist frequency, is real: not like the others.
        usable = (self.recording.samples - 1) // 2
        ends = np.array(band_hz) * (1 + np.array([-1e-9, 1e-9]))
        first, last = np.searchsorted(self.frequency_hz, ends)
        lines = slice(max(first, 1), min(last, usable + 1))
        frequency, position = self.frequency_hz[lines], self.position[lines]
        # Eight windows in a narrow band, too.
        decades = min(1 / 80, 0.99 * np.log10(band_hz[1] / band_hz[0]) / FEWEST_WINDOWS)
        edges = window_edges(frequency, minimum, decades)
        if len(edges) <= FEWEST_WINDOWS:
            raise InputError(_too_short(self.recording, band_hz, minimum, len(frequency), what))
        power = np.add.reduceat(np.abs(position) ** 2, edges[:-1]) / np.diff(edges)
        return RandomSpectra(
            frequency_hz=frequency,
            force=self.force[lines],
            position=position,
            edges=edges,
            floor=self.rounding**2 + REPEATS_TO**2 * power,
            reference=unit_mass,
        )


def _too_short(
    recording: Recording, band_hz: tuple[float, float], minimum: int, lines: int, what: str
) -> str:
    """What to say when the band holds too few lines."""
    needed, (low, high) = FEWEST_WINDOWS * minimum, band_hz
    unusual = unusual_period(recording.period_s)
    if unusual is not None:
        return f"{recording.name}: {unusual}"
    where = f"{recording.name}: {recording.samples} samples ({recording.duration_s:.3g} s)"
    if lines and high < 0.5 / recording.period_s:
        return (
            f"{where} are too few: {what} {low:.4g} to {high:.4g} Hz, {lines} lines of the "
            f"spectrum, and {needed} are needed; record {needed / (high - low):.3g} s, or use a "
            f"band that is {needed / recording.duration_s:.3g} Hz wide"
        )
    seconds = max((FEWEST_WINDOWS + LOW_END_WINDOWS) * minimum / high, SHORTEST_S)
    return f"{where} are too few for a frequency response; record at least {seconds:.2g} s"


def _detrended(values: NDArray[Any]) -> NDArray[Any]:
    """Without the straight line of least squares: large offsets cost digits."""
    time = np.arange(len(values)) - (len(values) - 1) / 2
    centred = values - values.mean()
    return centred - time * (time @ centred) / (time @ time)
