"""A rough frequency response, for checks at the door."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Complexes, Floats


class RoughResponse(NamedTuple):
    """Position over force by averaged segments, on the lines where the force has power.

    Attributes
    ----------
    frequency_hz, response, coherence : ndarray, shape (F,)
    """

    frequency_hz: Floats
    response: Complexes
    coherence: Floats

    @property
    def follows(self) -> float:
        """The coherence that nine lines in ten do not reach."""
        return float(np.quantile(self.coherence, 0.9))

    def clear(self) -> RoughResponse:
        """The lines on which the position follows the force."""
        kept = self.coherence > 0.7
        return RoughResponse(self.frequency_hz[kept], self.response[kept], self.coherence[kept])


def rough_response(recording: Recording) -> RoughResponse:
    """Welch's averages over a twelfth of the recording, or 4096 samples.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    RoughResponse
    """
    from scipy.signal import csd, welch

    segment = int(min(4096, recording.samples // 12))
    options = {"fs": 1 / recording.period_s, "nperseg": segment, "detrend": "linear"}
    frequency, force_power = welch(recording.force, **options)
    _, position_power = welch(recording.position, **options)
    _, cross = csd(recording.force, recording.position, **options)
    excited = force_power > 1e-4 * force_power.max()
    excited[:3] = False  # the window smears drift over the first lines
    if not np.any(excited):
        excited[3:] = True
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(cross) ** 2 / (force_power * position_power))
        response = cross / force_power
    return RoughResponse(frequency[excited], response[excited], coherence[excited])
