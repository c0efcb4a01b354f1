"""Limits that lie where nothing was measured, of a model that lacks something."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.diagnosis.traced import UNEXPLAINED
from bayeshaptic.quantities import interval, quantity

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


def beyond_band(closed: Closed) -> str | None:
    """Why a limit outside the band leaves no stiffness; None where it does not.

    How far what is unexplained may move the response is read off the residual, which ends with the
    band.  Of 21 recordings of strangers (12 of them shorter than 2.5 s) that had a stiffness beside
    something unexplained, the limits of four lay outside: two of these stiffnesses were above it,
    1.6 and 2.0 times, and none of the other 17.
    """
    analysis = closed.analysis
    if closed.verdict != UNEXPLAINED or analysis.in_loop is not None:
        return None
    (low, high), frequency = analysis.etfe.band_hz, analysis.limit.frequency_hz
    frequency = frequency[frequency > 0]  # of the draws that have a limit
    mostly = 0.5
    if not len(frequency) or np.mean((frequency < low) | (frequency > high)) <= mostly:
        return None
    return (
        f"something is left that nothing explains, and the limit, at "
        f"{quantity(float(np.median(frequency)), 'Hz')}, lies outside the band that was measured "
        f"({interval(low, high, 'Hz')}), where nothing tells how far that may take it"
    )
