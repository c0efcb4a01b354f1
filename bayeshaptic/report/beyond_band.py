"""Limits that lie where nothing was measured, of a model that lacks something."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.traced import UNEXPLAINED
from bayeshaptic.quantities import interval, quantity

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


def beyond_band(closed: Closed) -> str | None:
    """Why a limit outside the band leaves no stiffness; None where it does not.

    How far what is unexplained may move the response is read off the residual, which ends with the
    band.  Of 21 recordings of strangers (12 of them shorter than 2.5 s) that had a stiffness beside
    something unexplained, the limits of four lay outside: two of these stiffnesses were above it,
    1.6 and 2.0 times, and none of the other 17.  The rule was found on these; how often it refuses
    what would have held is not counted on others.
    """
    analysis = closed.analysis
    if closed.verdict != UNEXPLAINED or analysis.in_loop is not None:
        return None
    low, high = analysis.etfe.band_hz
    outside = [
        (one.probability, one.frequency_hz)
        for one in analysis.limit.crossings
        if one.frequency_hz is not None and not low <= one.frequency_hz <= high
    ]
    mostly = 0.5
    if sum(probability for probability, _ in outside) <= mostly:
        return None
    where = quantity(max(outside)[1], "Hz")
    return (
        f"something is left that nothing explains, and the limit, at {where}, lies outside the "
        f"band that was measured ({interval(low, high, 'Hz')}), where nothing tells how far that "
        "may take it"
    )
