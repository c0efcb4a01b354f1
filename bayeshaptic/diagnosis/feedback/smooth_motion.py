"""A motion smoothed, with the derivatives that terms and laws of forces are over."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from bayeshaptic.numerics.low_pass import low_pass
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import count_of
from bayeshaptic.types import Bools, Floats

_BAND = 0.05  # of the sampling rate: in which the motion that laws are over is smooth
# Of the acceleration's power, that counts may be. Of 20 loops of one mass of another simulation six
# have more, 0.23 to 0.62, and four of these were not known as one mass; of ten with a mode or a
# hand nine have less than 0.001, and keep their cut-off.
_MOST_COUNTS = 0.05
_FEWEST_PERIODS = 54  # of the cut-off, in a recording: what inverse dynamics need


@dataclass(frozen=True)
class SmoothMotion:
    """A motion without what the encoder adds: position, velocity, acceleration, jerk, (N,)."""

    position: Floats = field(repr=False)
    velocity: Floats = field(repr=False)
    acceleration: Floats = field(repr=False)
    jerk: Floats = field(repr=False)


def below_the_counts(recording: Recording) -> float:
    """The cut-off of the smoothing, Hz, below which counts are little of the acceleration.

    It is a twentieth of the sampling rate, halved while counts are more than that.  By the counts'
    share of its power the mass comes out too small, and what is missing looks like another mass, or
    like damping that changes with the frequency.  The share falls with the fifth power of the
    cut-off, so that one octave is enough for slow motions and coarse counts.

    Parameters
    ----------
    recording : Recording
        In one piece.
    """
    cutoff_hz, count = _BAND / recording.period_s, count_of(recording)
    while _share_of_counts(recording, count, cutoff_hz) > _MOST_COUNTS:
        if 0.5 * cutoff_hz * recording.duration_s < _FEWEST_PERIODS:
            break
        cutoff_hz *= 0.5
    return cutoff_hz


def _share_of_counts(recording: Recording, count: float, cutoff_hz: float) -> float:
    """Of the smoothed acceleration's power, what rounding to counts makes."""
    edge = int(np.ceil(2 / (cutoff_hz * recording.period_s)))
    if recording.samples <= 4 * edge:
        return 0.0
    impulse = np.zeros(4 * edge + 1)
    impulse[2 * edge] = count / np.sqrt(12)
    alone = Recording(impulse, impulse, recording.period_s)
    of_counts, of_all = (
        smooth_motion(one, cutoff_hz).acceleration[edge:-edge] for one in (alone, recording)
    )
    return float(of_counts @ of_counts) / max(float(np.var(of_all)), np.finfo(float).tiny)


def at_rest(recording: Recording, cutoff_hz: float) -> Bools:
    """Samples at which the position stays within a count for a period of the cut-off, (N,).

    Dry friction is there whatever holds the mass, and the motion says nothing of it.
    """
    count = count_of(recording)
    length = max(int(1 / (cutoff_hz * recording.period_s)), 1)
    y = recording.position
    still = maximum_filter1d(y, length) - minimum_filter1d(y, length) <= 2.01 * count
    return np.asarray(maximum_filter1d(still.astype(np.int8), length) > 0)


def smooth_motion(recording: Recording, cutoff_hz: float) -> SmoothMotion:
    """Low-passed, and central differences."""
    x = low_pass(recording.position, cutoff_hz, recording.period_s)
    v = np.gradient(x, recording.period_s)
    a = np.zeros_like(x)
    a[1:-1] = (x[2:] - 2 * x[1:-1] + x[:-2]) / recording.period_s**2
    return SmoothMotion(x, v, a, np.gradient(a, recording.period_s))


def smooth_pieces(recording: Recording) -> SmoothMotion:
    """Of the pieces of a recording, one after the other."""
    paths = [smooth_motion(piece, below_the_counts(piece)) for piece in recording.pieces]
    return SmoothMotion(*map(np.concatenate, zip(*map(astuple, paths), strict=True)))
