"""What dry friction does while it holds a mass in a hand.

While the mass rests, friction equals all other forces, a hand's among them.  How much of them is
the hand's can only be told by the fact that hands move smoothly.  Simulated forces agree with any
motion of the hand at rest: with a wrong one, friction that was 13 % too small fitted best, and the
limit came out 0.5 dB too high (docs/closed-loop.md).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.models.response.motion import linear_motion
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.low_pass import ORDER
from bayeshaptic.recordings.checks.sufficiency import standstill
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.rows.runs import runs
from bayeshaptic.types import Floats

# A hand wanders below this; what it does above falls so steeply that the velocity's whole band
# weighs about alike.
_WANDERS_HZ = 2.0
_APART_S, _MOST = 0.025, 100  # between the knots of a force at rest, and about how many at most
_RIDGE = 1e-3  # of the squares
_LARGEST = 2e7  # numbers in a matrix, 160 MB


@dataclass(frozen=True)
class AtRest:
    """Where a recording rests, and what forces then do.

    Attributes
    ----------
    period_s : float
    edge_hz : float
        Of what is slow.
    moved : ndarray, shape (N, K)
        What forces at rest, straight lines between knots, add to the motion: of each knot.
    told : ndarray, shape (K, N)
        From `_fast_velocity` of a motion to the forces in it that make it least.
    """

    period_s: float
    edge_hz: float
    moved: Floats
    told: Floats

    def smoothest(self, motion: Floats) -> Floats:
        """A hand's motion (N,) with what a force at rest may have done taken off."""
        return motion - self.moved @ (
            self.told @ _fast_velocity(motion, self.period_s, self.edge_hz)
        )


def at_rest(recording: Recording, system: LinearSystem, edge_hz: float) -> AtRest | None:
    """Where a recording rests, and what forces at the motor do then.

    None where it does not rest, or is too long or sampled too slowly to see a hand.

    Parameters
    ----------
    recording : Recording
    system : LinearSystem
        A batch of one.
    edge_hz : float
        Up to where a hand's motion is read off the encoder.
    """
    knots, period_s = _knots(recording), recording.period_s
    count = sum(len(own) for own in knots)
    if not knots or recording.samples * count > _LARGEST or edge_hz < 2 * _WANDERS_HZ:
        return None
    bare = replace(system, delay_s=np.zeros(1), filters=())
    pulses = (pulse for own in knots for pulse in _pulses(own, recording.samples))
    moved = np.stack([linear_motion(bare, pulse, period_s)[0] for pulse in pulses], axis=1)
    fast = _fast_velocity(moved, period_s, edge_hz)
    alike = fast.T @ fast
    alike[np.diag_indices_from(alike)] *= 1 + _RIDGE
    told = np.asarray(np.linalg.solve(alike, fast.T), float)
    return AtRest(period_s, edge_hz, moved, told)


def _rests(recording: Recording) -> list[tuple[int, int]]:
    """First sample and end of each stretch that lasts for a standstill's time."""
    count, length = standstill(recording)
    position = recording.position
    span = maximum_filter1d(position, length) - minimum_filter1d(position, length)
    still = maximum_filter1d((span <= 1.01 * count).astype(int), length) > 0
    starts, stops = runs(still)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def _knots(recording: Recording) -> list[Floats]:
    """Samples between which a force goes straight, of each rest: from its first to its last."""
    rests = _rests(recording)
    resting = sum(stop - first for first, stop in rests)
    apart = max(_APART_S / recording.period_s, resting / _MOST)
    return [
        np.linspace(first, stop - 1, max(round((stop - first) / apart), 1) + 1)
        for first, stop in rests
    ]


def _pulses(knots: Floats, samples: int) -> Iterator[Floats]:
    """A force of one at each knot in turn, none at the others, nor before and after them."""
    every = np.arange(samples)
    for unit in np.eye(len(knots)):
        yield np.interp(every, knots, unit, left=0.0, right=0.0)


def _fast_velocity(motion: Floats, period_s: float, edge_hz: float) -> Floats:
    """The velocity of a motion, shape (N, ...), between where hands wander and the edge."""
    band = butter(ORDER, [_WANDERS_HZ, edge_hz], btype="bandpass", fs=1 / period_s, output="sos")
    return np.asarray(np.gradient(sosfiltfilt(band, motion, axis=0), period_s, axis=0))
