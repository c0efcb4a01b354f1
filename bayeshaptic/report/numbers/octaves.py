"""The residual gathered in third octaves, beside what pure noise would give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

BAND_OCTAVES = 1 / 3
EXPECTED = (0.005, 0.995)


@dataclass(frozen=True)
class BandResidual:
    """Root mean square of the normalised residual in third octaves, arrays of shape (K,).

    1 is the noise; `low` to `high` holds 99 % of what pure noise gives with that many points.
    """

    frequency_hz: NDArray[Any]
    rms: NDArray[Any]
    low: NDArray[Any]
    high: NDArray[Any]


def third_octaves(frequency_hz: NDArray[Any], residual: NDArray[Any]) -> BandResidual:
    """The complex residual of shape (L,), normalised to E|r|^2 = 1, gathered in third octaves."""
    octave = np.log2(frequency_hz / frequency_hz[0])
    index = np.minimum(octave / BAND_OCTAVES, octave[-1] / BAND_OCTAVES - 1e-9).astype(int)
    _, index = np.unique(index, return_inverse=True)
    count = np.bincount(index)
    power = np.bincount(index, np.abs(residual) ** 2) / count
    centre = np.exp(np.bincount(index, np.log(frequency_hz)) / count)
    low, high = (np.sqrt(gammaincinv(count, p) / count) for p in EXPECTED)
    return BandResidual(centre, np.sqrt(power), low, high)
