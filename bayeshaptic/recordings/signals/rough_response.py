"""A rough frequency response, for checks at the door."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Complexes, Floats

_LOW = 0.1  # of the sampling rate: above it a delay counts too much
_DELAY = 2.0  # periods, hold included
_LOWER_HALF = 0.25  # of the sampling rate
_HALF_OCTAVE = 0.5
_FEWEST = 6  # lines of an octave whose median chance does not lift


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
        """The median coherence of the octave in which the position follows the force best.

        White noise of a fast loop goes far beyond what an encoder shows of the motion, and the band
        ends where that is; nine lines in ten may lie above.
        """
        octaves = np.log2(self.frequency_hz / self.frequency_hz[0])
        count = np.floor(2 * octaves[-1]).astype(int) - 1
        pieces = [np.abs(octaves - 0.5 * k - 0.5) <= _HALF_OCTAVE for k in range(max(count, 0))]
        medians = [np.median(self.coherence[p]) for p in pieces if np.sum(p) >= _FEWEST]
        return float(max(medians, default=np.median(self.coherence)))

    def clear(self) -> RoughResponse:
        """The lines on which the position follows the force."""
        kept = self.coherence > 0.7
        return RoughResponse(self.frequency_hz[kept], self.response[kept], self.coherence[kept])

    def opposite(self, period_s: float) -> bool:
        """Whether the position goes against the force.

        What falls with a power n of the frequency has a phase of -90 degrees times n (H. W. Bode,
        *Network Analysis and Feedback Amplifier Design*, 1945); with the sign turned round it has
        the opposite one.  The cosine between both, averaged over log frequency below a tenth of the
        sampling rate and less two periods of delay, is 0.54 to 1 in 137 simulated open loops.
        """
        clear = self.clear()
        low = clear.frequency_hz < _LOW * 1 / period_s
        frequency, response = clear.frequency_hz[low], clear.response[low]
        fewest = 12  # lines that tell a slope
        if len(frequency) < fewest:
            return False
        x, y = np.log(frequency), np.log(np.abs(response))
        near = 0.35  # of log frequency, for a slope
        slope = local_slopes(x, y, near, 1 / frequency)
        delay = 2 * np.pi * frequency * _DELAY * period_s
        expected = 0.5 * np.pi * np.clip(slope, -2.0, 0.0) - delay
        agreement = np.average(np.cos(np.angle(response) - expected), weights=1 / frequency)
        against = -0.3
        return bool(agreement < against)

    def is_velocity(self, period_s: float) -> bool:
        """Whether what should be a position is the velocity of one mass with a damper.

        As the velocity it is explained to 5 % (of its power), and ten times better than as the
        position.  Of 239 simulated open loops of all kinds of devices none is explained more than
        2.1 times better; the measured speed of a motor leaves 0.25 %, and 40 % as a position.
        """
        clear = self.clear()
        low = clear.frequency_hz < _LOWER_HALF / period_s
        fewest = 12
        if np.count_nonzero(low) < fewest:
            return False
        s: Complexes = np.asarray(2j * np.pi * clear.frequency_hz[low], complex)
        response = clear.response[low]
        as_velocity = _left_by_one_mass(s, response, period_s)
        as_position = _left_by_one_mass(s, np.asarray(s * response), period_s)
        plain, better = 0.05, 0.1
        return bool(as_velocity < min(plain, better * as_position))


def local_slopes(x: Floats, y: Floats, near: float, weight: Floats | float = 1.0) -> Floats:
    """Slope of y over x around each x, by least squares with a Gaussian weight; shape (N,).

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    near : float
        Standard deviation of the Gaussian, in units of x.
    weight : ndarray, shape (N,), or float
        Of each point, besides.
    """
    beside = weight * np.exp(-0.5 * ((x - x[:, None]) / near) ** 2)
    beside /= beside.sum(axis=1, keepdims=True)
    apart = x - (beside @ x)[:, None]
    return np.asarray(np.sum(beside * apart * y, axis=1) / np.sum(beside * apart**2, axis=1))


def _left_by_one_mass(s: Complexes, velocity: Complexes, period_s: float) -> float:
    """What of one is left by (m s + b) exp(s delay) velocity, its power averaged over log s."""
    from scipy.optimize import nnls

    weight = np.sqrt(1 / np.abs(s) / np.sum(1 / np.abs(s)))
    one = np.concatenate([weight, np.zeros(len(s))])
    left = []
    for delay in np.linspace(0, 3, 31) * period_s:
        columns = (
            weight[:, None] * (np.exp(s * delay) * velocity)[:, None] * np.stack([s, 1 + 0 * s], 1)
        )
        stacked = np.concatenate([columns.real, columns.imag])
        left.append(nnls(stacked / np.linalg.norm(stacked, axis=0), one)[1] ** 2)
    return float(min(left))


def rough_response(recording: Recording) -> RoughResponse:
    """Welch's averages over a twelfth of the recording, or 4096 samples, none across its joints.

    Parameters
    ----------
    recording : Recording

    Returns
    -------
    RoughResponse
    """
    from scipy.signal import csd, welch

    longest = max(span.stop - span.start for span in recording.spans)
    segment = int(min(4096, recording.samples // 12, longest))
    options = {"fs": 1 / recording.period_s, "nperseg": segment, "detrend": "linear"}
    pieces = [span for span in recording.spans if span.stop - span.start >= segment]
    sums: list[Complexes] = []
    for span in pieces:
        force, position = recording.force[span], recording.position[span]
        frequency, pushes = welch(force, **options)
        powers = pushes, welch(position, **options)[1], csd(force, position, **options)[1]
        sums.append((2 * len(force) // segment - 1) * np.array(powers, dtype=complex))
    force_power, position_power, cross = np.sum(sums, axis=0)
    force_power, position_power = force_power.real, position_power.real
    excited = force_power > 1e-4 * force_power.max()
    excited[:3] = False  # the window smears drift over the first lines
    if not np.any(excited):
        excited[3:] = True
    with np.errstate(divide="ignore", invalid="ignore"):
        coherence = np.nan_to_num(np.abs(cross) ** 2 / (force_power * position_power))
        response = cross / force_power
    return RoughResponse(frequency[excited], response[excited], coherence[excited])
