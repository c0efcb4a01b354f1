"""A motion smoothed, with the derivatives that terms and laws of forces are over."""

from __future__ import annotations

from dataclasses import astuple, dataclass, field

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Bools, Floats

_BAND = 0.05  # of the sampling rate: in which the motion that laws are over is smooth


@dataclass(frozen=True)
class SmoothMotion:
    """A motion without what the encoder adds: position, velocity, acceleration, jerk, (N,)."""

    position: Floats = field(repr=False)
    velocity: Floats = field(repr=False)
    acceleration: Floats = field(repr=False)
    jerk: Floats = field(repr=False)


def smoothed(signal: Floats, cutoff_hz: float, period_s: float) -> Floats:
    """Zero-phase low-pass, Butterworth, order 4, forwards and backwards."""
    low = butter(4, cutoff_hz, fs=1 / period_s, output="sos")
    return np.asarray(sosfiltfilt(low, signal))


def at_rest(recording: Recording, cutoff_hz: float) -> Bools:
    """Samples at which the position stays within a count for a period of the cut-off, (N,).

    Dry friction is there whatever holds the mass, and the motion says nothing of it.
    """
    count = recording.encoder_resolution or increment_unit(recording.position) or 0.0
    length = max(int(1 / (cutoff_hz * recording.period_s)), 1)
    y = recording.position
    still = maximum_filter1d(y, length) - minimum_filter1d(y, length) <= 2.01 * count
    return np.asarray(maximum_filter1d(still.astype(np.int8), length) > 0)


def smooth_motion(recording: Recording, cutoff_hz: float) -> SmoothMotion:
    """Low-passed, and central differences."""
    x = smoothed(recording.position, cutoff_hz, recording.period_s)
    v = np.gradient(x, recording.period_s)
    a = np.zeros_like(x)
    a[1:-1] = (x[2:] - 2 * x[1:-1] + x[:-2]) / recording.period_s**2
    return SmoothMotion(x, v, a, np.gradient(a, recording.period_s))


def smooth_pieces(recording: Recording) -> SmoothMotion:
    """Of the pieces of a recording, one after the other."""
    paths = [smooth_motion(piece, _BAND / piece.period_s) for piece in recording.pieces]
    return SmoothMotion(*map(np.concatenate, zip(*map(astuple, paths), strict=True)))
