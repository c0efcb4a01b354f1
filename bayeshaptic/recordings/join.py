"""Several recordings of one device as one: pieces that count together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.read import recording_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.sensed import Sensed
from bayeshaptic.recordings.signals.rows.pauses import FEWEST_SAMPLES
from bayeshaptic.types import Floats


@at_the_door
def join_recordings(
    recordings: Sequence[Recording | str | Path], name: str | None = None
) -> Recording:
    """Recordings of one device, held alike, as one recording of several pieces.

    All pieces say something of the same masses, springs, friction and delay; where each begins,
    how it moves there, and its noise are its own.

    Parameters
    ----------
    recordings : sequence of Recording or path
        With the same period and units.
    name : str, optional
        That of the first, and how many more there are, by default.

    Returns
    -------
    Recording
        With the facts of the first, and `joints` where the others begin; of no one file.

    Raises
    ------
    InputError
        Where there are none, where one is there twice, where period or units differ, or where one
        is far too short.
    """
    if not len(recordings):
        raise InputError("there are no recordings to join")
    read = [recording_of(one) for one in recordings]
    first = read[0]
    _refuse_unlike(read)
    if len(read) == 1:
        return first
    pieces = [piece for recording in read for piece in recording.pieces]
    _refuse_twice(pieces)
    ends = np.cumsum([piece.samples for piece in pieces])
    notices = dict.fromkeys(notice for recording in read for notice in recording.notices)
    text = (
        f"{len(read)} recordings are taken as one: "
        f"{', '.join(recording.name for recording in read)}. What says that they differ "
        "(a user, a configuration, a trial or a level of their own) keeps them apart."
    )
    return replace(
        first,
        force=np.concatenate([piece.force for piece in pieces]),
        position=np.concatenate([piece.position for piece in pieces]),
        name=name or name_of_several(first.name, len(read) - 1),
        source=None,
        notices=(*notices, Notice("note", "pieces", text)),
        joints=tuple(int(end) for end in ends[:-1]),
        joined=tuple(piece.name for piece in pieces),
        reference=_references(pieces),
        sensed=_sensed(pieces),
    )


def name_of_several(first: str, others: int) -> str:
    """What recordings that count together are called: ``step and 3 others``.

    Parameters
    ----------
    first : str
        The name of the first.
    others : int
        How many count with it.
    """
    return f"{first} and {others} other{'s' if others > 1 else ''}" if others else first


def _refuse_unlike(recordings: Sequence[Recording]) -> None:
    """Refuse what has another period or other units than the first, or is far too short."""
    first = recordings[0]
    for other in recordings:
        if not same_period(other.period_s, first.period_s):
            raise InputError(
                f"{other.name} is sampled every {other.period_s:g} s and {first.name} every "
                f"{first.period_s:g} s: they cannot be one; analyse them apart"
            )
        units = (other.force_unit, other.position_unit)
        if units != (first.force_unit, first.position_unit):
            raise InputError(
                f"{other.name} is in {units[0]} and {units[1]}, {first.name} in "
                f"{first.force_unit} and {first.position_unit}: give both in the same units"
            )
        if other.samples < FEWEST_SAMPLES:
            raise InputError(
                f"{other.name}: {other.samples} samples are too few even for a piece; leave it "
                f"out, or record at least {FEWEST_SAMPLES}"
            )


def same_period(one_s: float, other_s: float) -> bool:
    """Whether two sampling periods differ by no more than clocks' stamps do.

    Parameters
    ----------
    one_s, other_s : float
    """
    return abs(one_s / other_s - 1) <= 1e-3


def _refuse_twice(pieces: Sequence[Recording]) -> None:
    """Refuse the same samples once more: they would count as twice the data."""
    known: dict[tuple[bytes, bytes], str] = {}
    for piece in pieces:
        content = (piece.force.tobytes(), piece.position.tobytes())
        if content in known:
            raise InputError(
                f"{piece.name} has the same samples as {known[content]}, and would count as twice "
                "the data; leave it out"
            )
        known[content] = piece.name


def _references(pieces: Sequence[Recording]) -> Floats | None:
    """What the controllers followed, one piece after the other; None where one does not say."""
    found = [piece.reference for piece in pieces if piece.reference is not None]
    return np.concatenate(found) if len(found) == len(pieces) else None


def _sensed(pieces: Sequence[Recording]) -> Sensed | None:
    """What was sensed in the pieces, one after the other; of one kind."""
    first, *others = (piece.sensed for piece in pieces)
    if any(other != first for other in others):
        raise InputError(
            "the recordings are not of the same outputs (position, velocity, acceleration, command "
            "or measured force): analyse them apart"
        )
    found = [piece.sensed for piece in pieces if piece.sensed is not None]
    if first is None or not found:
        return None
    return replace(
        first,
        force=np.concatenate([one.force for one in found]),
        output=np.concatenate([one.output for one in found]),
    )


def unbroken(recording: Recording) -> Recording:
    """The recording with each piece moved to where the one before ended, for what looks at samples.

    A position that jumps where nothing moved would be taken for motion.
    """
    if not recording.joints:
        return recording
    position, end = [], 0.0
    for piece in recording.pieces:
        moved = piece.position - piece.position[0] + end
        end = float(moved[-1])
        position.append(moved)
    return replace(recording, position=np.concatenate(position), joints=())
