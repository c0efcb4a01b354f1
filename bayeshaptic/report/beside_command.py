"""What a device does beside its command, and what may be behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.samples.command_times import TOPIC
from bayeshaptic.quantities import percent
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.report.numbers.result import may_be_held

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

# Speed that the command does not make, over that which it makes, from which a limit is in doubt. 46
# clean devices of two simulations that nobody holds stay below 0.03 (0.13 under a sweep of 2 s).
_BESIDES = 0.25
_LATE = "commands take effect early or late"


def beside_command(analysis: Analysis) -> str | None:
    """Why a limit is in doubt where a device moves beside what its command does; else None.

    Parameters
    ----------
    analysis : Analysis
    """
    if not _is_moved(analysis):
        return None
    if _is_off_its_time(analysis):
        what = f"{_LATE}, some more than others"
    else:
        hand = "a hand (--held yes) or " if may_be_held(analysis) else ""
        what = (
            f"something else moves it, {hand}the floor, or a force that was not found, or {_LATE}, "
            "or rows of several recordings stand one after another"
        )
    return (
        "the device moves beside what its command does, at more than "
        f"{percent(_BESIDES)} of that speed: {what}, and dry friction beside such a motion looks "
        "like damping"
    )


def what_changes(analysis: Analysis) -> str:
    """What may make the same command do something else from moment to moment.

    Parameters
    ----------
    analysis : Analysis
    """
    if _is_off_its_time(analysis):
        return _LATE
    return f"a mode that wanders, a cable that slips, friction, or {_LATE}"


def _is_moved(analysis: Analysis) -> bool:
    """Whether something but the command moves a device that nobody is said to hold."""
    recording = analysis.etfe.unbroken
    if analysis.model.held or not analysis.sampled or analysis.etfe.through_reference:
        return False
    if recording is None or analysis.in_loop is not None or has_feedback(analysis.notices):
        return False
    return analysis.moved_besides > _BESIDES


def _is_off_its_time(analysis: Analysis) -> bool:
    """Whether commands were seen to take effect early or late."""
    return any(notice.topic == TOPIC for notice in analysis.notices)
