"""Every row of the clock, with a position that goes on across its jumps, run by run of a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.signals.rows.pauses import Run
from bayeshaptic.recordings.signals.rows.timing import Timing
from bayeshaptic.recordings.signals.turns import unwrapped, without_jumps
from bayeshaptic.types import Floats, Ints


@dataclass(frozen=True)
class Signals:
    """What is recorded at each sample; the reference where there is one."""

    force: Floats
    position: Floats
    reference: Floats | None

    def __getitem__(self, rows: slice | Ints) -> Signals:
        followed = None if self.reference is None else self.reference[rows]
        return Signals(self.force[rows], self.position[rows], followed)


@dataclass(frozen=True)
class Rows:
    """The signals on an even clock, the rows at which other motions begin, and what to say."""

    signals: Signals
    period_s: float
    joints: tuple[int, ...]
    notices: tuple[Notice, ...]


def continued(
    signals: Signals, runs: Sequence[Run], angle: bool, count: float | None, where: str
) -> Rows:
    """Every row of the clock, the position counted on across its jumps.

    Parameters
    ----------
    signals : Signals
        As they stand in the file.
    runs : sequence of Run
        Each with a clock of its own; nothing is known of what lies between them.
    angle : bool
        Whether the position is one, in rad.
    count : float or None
        Of the encoder.
    where : str
        Beginning of messages.

    Raises
    ------
    InputError
        Where a position cannot be counted on, and where a run repeats another.
    """
    found = [_one_run(signals[run.rows], run.timing, angle, count, where) for run in runs]
    if len(found) == 1:
        return found[0]
    _refuse_repeated(found, runs, where)
    edges = np.cumsum([0, *(len(rows.signals.force) for rows in found)]).tolist()
    joints = [
        start + joint for start, rows in zip(edges, found, strict=False) for joint in rows.joints
    ]
    return Rows(
        _one_after_the_other([rows.signals for rows in found]),
        found[int(np.argmax(np.diff(edges)))].period_s,
        tuple(sorted([*joints, *edges[1:-1]])),
        tuple(
            replace(notice, text=f"In the rows from {run.rows.start + 1} on: {notice.text}")
            for run, rows in zip(runs, found, strict=True)
            for notice in rows.notices
        ),
    )


def _one_run(
    signals: Signals, timing: Timing, angle: bool, count: float | None, where: str
) -> Rows:
    position, notices = unwrapped(signals.position, angle, count, where)
    signals = replace(signals, position=position)
    if timing.rows is not None:
        from bayeshaptic.recordings.signals.rows.gaps import put_back

        signals = Signals(*put_back(**vars(signals), rows=timing.rows, where=where))
    position, joints, jumps = without_jumps(signals.position, signals.force, timing.period_s)
    signals = replace(signals, position=position)
    return Rows(signals, timing.period_s, joints, (*notices, *timing.notices, *jumps))


def _refuse_repeated(found: Sequence[Rows], runs: Sequence[Run], where: str) -> None:
    """Refuse the same samples once more: they would count as twice the data."""
    known: dict[tuple[bytes, bytes], int] = {}
    for rows, run in zip(found, runs, strict=True):
        content = (rows.signals.force.tobytes(), rows.signals.position.tobytes())
        first = run.rows.start + 1
        if content in known:
            raise InputError(
                f"{where}: the run that begins at row {first} has the same samples as that at row "
                f"{known[content]}, and would count as twice the data; leave it out (--rows)",
                topic="rows",
            )
        known[content] = first


def _one_after_the_other(signals: Sequence[Signals]) -> Signals:
    references = [one.reference for one in signals if one.reference is not None]
    joined = Signals(
        np.concatenate([one.force for one in signals]),
        np.concatenate([one.position for one in signals]),
        np.concatenate(references) if references else None,
    )
    for signal in (joined.force, joined.position):
        signal.setflags(write=False)
    return joined
