"""Held devices that dry friction holds still for much of a recording in closed loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.effects.library import force_laws
from bayeshaptic.quantities import percent
from bayeshaptic.recordings.checks.sufficiency import MOST_IDLE, share_at_rest

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


def held_still(closed: Closed) -> str | None:
    """Why friction that holds a held device leaves its limit open; None where it does not.

    While the motor rests nothing is seen of the hand, and what friction and hand do then is told
    apart by assumption.  Of three such loops that had a stiffness the medians of the limit were 0.3
    to 1.0 dB too high, and one stiffness by 3.8 %; without a hand friction at rest is the command,
    and four of four intervals held the limit (docs/closed-loop.md).
    """
    analysis = closed.analysis
    recording = analysis.recording
    if not (analysis.etfe.direct and analysis.model.held) or recording is None:
        return None
    if not any(kind.sticks for kind in force_laws(closed.effect_names)):
        return None
    still = share_at_rest(recording)
    if still <= MOST_IDLE:
        return None
    return (
        f"dry friction holds the device for {percent(still)} of the recording, in which nothing is "
        "seen of the hand that holds it, too, and the limit may come out too high"
    )
