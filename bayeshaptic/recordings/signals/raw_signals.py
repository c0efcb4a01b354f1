"""Facts that the raw samples show, before any estimate: resolution, clipping."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.recording import Recording

# A clipped extreme holds more samples than this, and this many times those of the level beside it.
CLIPPED_SAMPLES = 30
CLIPPED_RATIO = 3
_COARSER = 1.05  # times a declared count: positions in steps up to this are in that


@dataclass(frozen=True)
class Clipping:
    """Samples on a signal's extremes.

    Attributes
    ----------
    low, high : float
        The extremes.
    low_samples, high_samples : int
        Samples on them.
    low_clipped, high_clipped : bool
        More than 30 samples there, and over three times as many as on a level just beside it.
    """

    low: float
    high: float
    low_samples: int
    high_samples: int
    low_clipped: bool
    high_clipped: bool


def increment_unit(signal: NDArray[Any]) -> float | None:
    """Common divisor of a signal's increments: the encoder count, or the rounding of the file.

    The smallest increments give a first value (also their halves, thirds and so on, for an encoder
    that never moved by one count); least squares over larger and larger increments refines it.

    Parameters
    ----------
    signal : ndarray, shape (N,)

    Returns
    -------
    float or None
        In the signal's unit; None where there is none: the signal is continuous, or constant.
    """
    steps = np.abs(np.diff(np.asarray(signal, dtype=float)))
    # The rounding of double precision itself is no resolution.
    dust = 64 * np.finfo(float).eps * np.abs(signal).max()
    steps = np.sort(steps[steps > dust])
    if len(steps) < 10:
        return None
    smallest = float(np.median(steps[steps < 1.25 * steps[0]]))
    for divisor in range(1, 7):
        unit = _refine(steps, smallest / divisor)
        # A unit at the level of the dust divides everything.
        if unit is not None and unit > 8 * dust:
            return unit
    return None


def _refine(steps: NDArray[np.float64], unit: float) -> float | None:
    """The unit refined over all increments (sorted), or None where they are no multiples of it."""
    reach = max(4.0, 1.01 * float(steps[0]) / unit)
    while True:
        part = steps[: np.searchsorted(steps, reach * unit, side="right")]
        counts = np.round(part / unit)
        if np.any(counts == 0):
            return None
        if np.abs(part / unit - counts).max() > 0.2:
            return None
        unit = float(counts @ part / (counts @ counts))
        if len(part) == len(steps):
            # A file may round its samples to a sixth of a count, no coarser; chance gives 0.1.
            return unit if np.abs(part / unit - counts).mean() < 0.08 else None
        # Grow by what the unit's own error allows, but at least to the next increment.
        reach = max(2 * reach, 1.01 * float(steps[len(part)]) / unit)


def count_of(recording: Recording) -> float:
    """One count of the encoder: as declared, or what the position moves by where that is coarser.

    Zero where it is neither declared nor seen.  Whoever asks what the positions are multiples of,
    whatever was declared, asks `increment_unit`: where they were averaged they are of nothing.
    """
    declared = recording.encoder_resolution or 0.0
    seen = increment_unit(recording.position) or 0.0
    return seen if seen > _COARSER * declared else declared


def clipping(signal: NDArray[Any]) -> Clipping:
    """Samples on the extremes of a signal, and whether it was clipped there.

    A signal that takes a few levels by design (a relay, a binary sequence) sits on both extremes
    all the time; it has nothing beside them, and is not called clipped.

    Parameters
    ----------
    signal : ndarray, shape (N,)

    Returns
    -------
    Clipping
    """
    levels, counts = np.unique(signal, return_counts=True)

    def clipped(on: int, beside: int) -> bool:
        return len(levels) > 10 and on > CLIPPED_SAMPLES and on > CLIPPED_RATIO * beside

    first, last = int(counts[0]), int(counts[-1])
    beside_low = int(counts[1]) if len(levels) > 1 else 0
    beside_high = int(counts[-2]) if len(levels) > 1 else 0
    return Clipping(
        low=float(levels[0]),
        high=float(levels[-1]),
        low_samples=first,
        high_samples=last,
        low_clipped=clipped(first, beside_low),
        high_clipped=clipped(last, beside_high),
    )
