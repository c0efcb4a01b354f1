"""The low-pass that motions are smoothed with: Butterworth, forwards and backwards."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.types import Floats

ORDER = 4  # of one way


def low_pass(signal: Floats, edge_hz: float, period_s: float) -> Floats:
    """A signal without what is faster than its edge, and without lag, shape (N,)."""
    low = butter(ORDER, edge_hz, fs=1 / period_s, output="sos")
    return np.asarray(sosfiltfilt(low, signal))


def slow_share(frequency_hz: Floats, edge_hz: float) -> Floats:
    """What `low_pass` keeps at frequencies in Hz, any shape."""
    return np.asarray(1 / (1 + (frequency_hz / edge_hz) ** (2 * ORDER)))
