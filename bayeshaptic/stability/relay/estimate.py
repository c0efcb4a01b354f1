"""The response around a relay's oscillation: its value, its crossing, and how sure they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayeshaptic.stability.relay.spectra import NEAR, PieceSpectra, oscillation
from bayeshaptic.types import Floats

BLOCKS = 10  # of the jackknife


@dataclass(frozen=True)
class SegmentFit:
    """Of one set of segments: what the jackknife repeats."""

    frequency_hz: float
    gain: float
    phase_deg: float
    crossing_hz: float
    critical: float


def estimate(spectra: PieceSpectra, order: int) -> SegmentFit:
    """U = D Y around the oscillation by least squares, D a polynomial; its value and crossing.

    The dynamic stiffness D = 1/G is smooth where G has a resonance.
    """
    centre, width = oscillation(spectra)
    lines = 4  # reach of the local fit on either side, at least
    half = max(3 * width, lines * spectra.bin_hz)
    use = np.abs(spectra.frequency_hz - centre) < half
    x = (spectra.frequency_hz[use] - centre) / half
    basis = (spectra.position[:, use, None] * x[:, None] ** np.arange(order + 1)).reshape(
        -1, order + 1
    )
    stiffness = np.linalg.lstsq(basis, spectra.force[:, use].ravel(), rcond=None)[0][::-1]
    here = stiffness[-1]
    root = _nearest_root(np.asarray(stiffness.imag, float))
    critical = -np.polyval(stiffness.real, root) if abs(root) < np.inf else np.nan
    return SegmentFit(
        centre,
        float(abs(here)),
        float(np.degrees(np.angle(-1 / here))),
        float(centre + half * root),
        float(critical) if critical > 0 else np.nan,
    )


def _nearest_root(coefficients: Floats) -> float:
    """The real root nearest to zero of a polynomial, highest power first; inf without one."""
    roots = np.roots(coefficients)
    real = roots[np.abs(roots.imag) < 1e-9 * (1 + np.abs(roots))].real
    return float(real[np.argmin(np.abs(real))]) if len(real) else np.inf


def jackknife(spectra: PieceSpectra, whole: SegmentFit) -> dict[str, float]:
    """Standard deviations: of the frequency in Hz, of the stiffnesses' logarithms."""
    count = len(spectra.force)
    blocks = np.array_split(np.arange(count), min(BLOCKS, count))
    without = [estimate(spectra.only(np.setdiff1d(np.arange(count), block)), 2) for block in blocks]

    def spread(read: Callable[[SegmentFit], Any]) -> float:
        values = np.array([read(estimate) for estimate in without], float)
        scatter = ((values - values.mean()) ** 2).sum()
        return float(np.sqrt((len(blocks) - 1) / len(blocks) * scatter))

    return {
        "frequency_hz": spread(lambda e: e.frequency_hz),
        "gain": spread(lambda e: np.log(e.gain)),
        "critical": spread(lambda e: np.log(e.critical)) if whole.critical > 0 else np.nan,
    }


def oscillation_share(spectra: PieceSpectra, frequency_hz: float) -> float:
    """The oscillation's share of the motion's variance, above half its frequency."""
    power = (np.abs(spectra.position) ** 2).mean(axis=0)
    counted = spectra.frequency_hz > 0.5 * frequency_hz
    near = np.abs(spectra.frequency_hz - frequency_hz) < NEAR * frequency_hz
    return float(power[near].sum() / power[counted].sum())
