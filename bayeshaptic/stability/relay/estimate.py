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
    """What is read of one set of segments, and what the jackknife repeats.

    Attributes
    ----------
    frequency_hz : float
        Of the oscillation.
    gain, phase_deg : float
        1/|G| there, a stiffness, and the phase of G from -180 degrees.
    crossing_hz : float
        Where the phase is -180 degrees; infinite where it is nowhere near.
    critical : float
        The stiffness there; nan without a crossing.
    """

    frequency_hz: float
    gain: float
    phase_deg: float
    crossing_hz: float
    critical: float


def estimate(spectra: PieceSpectra, order: int) -> SegmentFit:
    """Fit the response around the oscillation, and read its value and its crossing.

    U = D Y is fitted by least squares with D a polynomial in the frequency, because the dynamic
    stiffness D = 1/G is smooth where G has a resonance.

    Parameters
    ----------
    spectra : PieceSpectra
    order : int
        Of the polynomial.

    Returns
    -------
    SegmentFit
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
    """Standard deviations of what is read, by leaving out one block of segments after the other.

    Segments that overlap are not independent, so that ten blocks of neighbours are left out (B.
    Efron, "The Jackknife, the Bootstrap and Other Resampling Plans", SIAM 1982).

    Parameters
    ----------
    spectra : PieceSpectra
    whole : SegmentFit
        Of all segments.

    Returns
    -------
    dict of str to float
        Of ``frequency_hz`` in Hz; of ``gain`` and ``critical`` in their logarithms.
    """
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
    """The oscillation's share of the motion's variance above half its frequency, 0 to 1.

    Below that a hand wanders.
    """
    power = (np.abs(spectra.position) ** 2).mean(axis=0)
    counted = spectra.frequency_hz > 0.5 * frequency_hz
    near = np.abs(spectra.frequency_hz - frequency_hz) < NEAR * frequency_hz
    return float(power[near].sum() / power[counted].sum())
