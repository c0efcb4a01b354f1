"""Angles that begin again after a turn: those of absolute encoders, compasses and arctangents."""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.types import Floats

_TURN = 2 * np.pi
# How far from a turn a jump may be, in fast steps elsewhere: what moves goes on across it.
_STEPS = 5.0


def unwrapped(angle: Floats) -> tuple[Floats, tuple[Notice, ...]]:
    """The angle in rad without its jumps by a turn, and a note of them; as it was without any.

    Jumps are by a turn where the angle stays within one, nothing else jumps by half of one, and
    what is left of each without the turn is a step as elsewhere. No device turns by half a turn
    between two samples: a reading that falls out does, and comes back by the same way.
    """
    steps = np.diff(angle)
    jumps = np.abs(steps) > _TURN / 2
    if not jumps.any() or jumps.all():
        return angle, ()
    moves = np.abs(steps[~jumps & (steps != 0)])
    most = _STEPS * float(np.quantile(moves, 0.95)) if len(moves) else 0.0
    left = np.abs(steps[jumps] - _TURN * np.sign(steps[jumps]))
    if np.ptp(angle) > _TURN + most or left.max() > most:
        return angle, ()
    count = int(np.count_nonzero(jumps))
    where = f"row {int(np.flatnonzero(jumps)[0]) + 2}"
    text = (
        f"The angle jumps by a turn {'once' if count == 1 else f'{count} times'}, the first time "
        f"at {where}: it was counted on across it."
    )
    return np.unwrap(angle), (Notice("note", "columns", text),)
