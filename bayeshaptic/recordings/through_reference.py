"""Closed loops whose reference is known: then the response can be estimated without bias."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.recordings.feedback import Feedback, doubts, has_feedback, how_computed
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.added_noise import command_innovations
from bayeshaptic.recordings.signals.causality.causality import causality
from bayeshaptic.recordings.signals.controller import controller_reference
from bayeshaptic.types import Floats

_INNOVATIONS = "innovations"  # what a note is about where these are the reference
_COLUMN = "the reference that was written down beside it"
_DECLARED = "the controller that [feedback] declares"
_READ_OFF = "the controller's law, which was read off the recording (exact between its targets),"
_UNFORETOLD = (
    "what neither its own past nor the motion up to then foretells of it (its innovations)"
)


def through_reference(
    recording: Recording, notices: tuple[Notice, ...]
) -> tuple[Recording, tuple[Notice, ...]]:
    """A recording with feedback, with the reference that it is to be read through, if one is known.

    A column that was written down, what a declared controller leaves of the command, what one does
    that shows its law to the last digit, or the command's innovations.  Neither of the first two is
    taken where it answers to the motion itself.

    Parameters
    ----------
    recording : Recording
    notices : tuple of Notice
        Those of its checks.

    Returns
    -------
    recording : Recording
        Its `reference` is None where none can be used, and in open loop.
    notices : tuple of Notice
        Without the warning of feedback where that biases nothing any more.
    """
    alone = replace(recording, reference=None)
    if not has_feedback(notices):
        return alone, notices
    if recording.reference is not None:
        found, what = recording.reference, _COLUMN
    elif recording.feedback is not None:
        found, what = _left_by(recording.feedback, recording), _DECLARED
    elif (left := controller_reference(recording)) is not None:
        found, what = left, _READ_OFF
    elif (left := command_innovations(recording)) is not None:
        found, what = left, _UNFORETOLD
    else:
        return alone, notices
    if np.ptp(found) == 0:
        return alone, (*notices, unusable(f"{what} never moves the command"))
    tried = replace(recording, reference=found)
    judged = causality(replace(tried, force=found))
    if what in (_COLUMN, _DECLARED) and judged.has_feedback:
        why = f"{what} answers to the motion itself ({judged.evidence})"
        return alone, (*notices, unusable(f"{why}: check its gains, its filter and its sign"))
    text = (
        f"The force {how_computed(notices)}; {what} tells what of it was not, and the "
        "response is read through that alone, so that feedback does not bias it."
    )
    how = (_INNOVATIONS,) if what == _UNFORETOLD else ()
    told = Notice("note", "feedback", text, how + doubts(notices))
    kept = (n for n in notices if (n.level, n.topic) != ("warning", "feedback"))
    return tried, (*kept, told)


def too_weak(before: tuple[Notice, ...], read: tuple[Notice, ...], why: str) -> tuple[Notice, ...]:
    """The notices of a recording whose reference says too little, and that it does.

    Of innovations that are too weak nothing is said: nobody knew of a reference.

    Parameters
    ----------
    before, read : tuple of Notice
        Without the reference, and with it: see `through_reference`.
    why : str
    """
    if any(_INNOVATIONS in notice.about for notice in read):
        return before
    return (*before, unusable(f"it does not help: {why}"))


def unusable(why: str) -> Notice:
    """The warning that a reference is known but not used, and why."""
    return Notice("warning", "reference", f"The reference is not used: {why}.")


def _left_by(feedback: Feedback, recording: Recording) -> Floats:
    """What the controller's law leaves of the command: its reference, through its numerator.

    With N over D the law, D u + N y = N r, whatever the states of the controller were.
    """
    from scipy.signal import lfilter

    above, below = feedback.law(recording.period_s)
    parts = []
    for piece in recording.pieces:
        left = lfilter(below, [1.0], piece.force) + lfilter(above, [1.0], piece.position)
        left[: max(len(above), len(below)) - 1] = 0.0
        parts.append(left)
    return np.concatenate(parts)
