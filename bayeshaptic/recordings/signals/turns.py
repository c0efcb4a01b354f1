"""Positions that begin again: angles after a turn, counters after their last count, new zeros."""

from __future__ import annotations

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.runs import HUNG
from bayeshaptic.types import Bools, Floats

_TURN = 2 * np.pi
# How far from a turn a jump may be, in fast steps elsewhere: what moves goes on across it.
_STEPS = 5.0
_OF_RANGE = 0.02  # five such steps are less than this share of the range
_FEWEST_BITS = 6  # of a counter
_FEWEST_STEPS = 100  # that tell what usual ones are
_FEWEST_JUMPS = 3  # fewer may lead from one place of work to another
_FARTHER = 8.0  # goes a jump to anywhere than any step around it,
_AROUND = 10  # rows before and after it,
_COUNTS = 20  # and than so many counts, which an encoder at rest does not flicker by
_MOST_OFTEN = 1e-3  # of all rows: what moves so more often is how it moves


def unwrapped(
    position: Floats, angle: bool, encoder_resolution: float | None, where: str
) -> tuple[Floats, tuple[Notice, ...]]:
    """The position without its jumps from one end to the other, and a note of them.

    Parameters
    ----------
    position : ndarray, shape (N,)
    angle : bool
        Whether it is one, in rad.
    encoder_resolution : float or None
    where : str
        How messages begin.

    Raises
    ------
    InputError
        Where it jumps so again and again, by what is neither a turn nor a power of two counts.
    """
    steps = np.diff(position)
    if angle and (jumps := _by_a_turn(position, steps)) is not None:
        return np.unwrap(position), (_note("The angle jumps by a turn", jumps),)
    found = _from_end_to_end(position, steps)
    if found is None:
        return position, ()
    jumps, size, most = found
    # As declared it is exact, as a whole counter of it has to be.
    count = encoder_resolution or increment_unit(position)
    if count is not None and (bits := _bits(size / count, most / count)):
        text = f"The position jumps by {2**bits:,} counts, as a counter of {bits} bits does,"
        return np.unwrap(position, period=2**bits * count), (_note(text, jumps),)
    if np.count_nonzero(jumps) < _FEWEST_JUMPS:
        return position, ()
    raise InputError(
        f"{where}: the position jumps {_times(jumps)} from one end of its range to the other, by "
        f"some {size:.4g}, the first time at {_first(jumps)}, as a counter does that begins again; "
        "count on across the jumps first (numpy.unwrap with its period), or leave out what lies "
        "beyond",
        topic="columns",
    )


def without_jumps(position: Floats) -> tuple[Floats, tuple[Notice, ...]]:
    """The position without jumps to anywhere, and a warning of them.

    No mass goes in one period eight times as far as in any of the ten before and after: an encoder
    was set to zero or missed counts, or what stands on both sides was not recorded in one go. A
    reading that hung, and is back where the device has gone since, is for those who fill it in.

    Parameters
    ----------
    position : ndarray, shape (N,)
    """
    steps = np.diff(position)
    size = np.abs(steps)
    if np.count_nonzero(steps) < _FEWEST_STEPS:
        return position, ()
    count = increment_unit(position) or 0.0
    # The most of ten steps: those before step k begin at its own place, those after ten further on.
    most = sliding_window_view(np.pad(size, _AROUND), _AROUND).max(axis=1)
    around = np.maximum(most[: len(steps)], most[_AROUND + 1 :])
    jumps = size > np.maximum(_FARTHER * around, max(_most(steps), _COUNTS * count))
    jumps &= ~_caught_up(size, jumps)
    if not 0 < np.mean(jumps) <= _MOST_OFTEN:
        return position, ()
    beside = np.pad(steps, 1)
    off = np.where(jumps, steps - (beside[:-2] + beside[2:]) / 2, 0.0)
    if count:
        off = count * np.round(off / count)
    edges = np.concatenate([[0], np.flatnonzero(jumps) + 1, [len(position)]])
    longest = int(np.argmax(np.diff(edges)))
    text = (
        f"The position jumps {_times(jumps)}, the first time at {_first(jumps)} by "
        f"{steps[jumps][0]:.4g}, farther than in any step around it: an encoder was set to zero or "
        "missed counts, rows were lost, or two recordings stand in one file. It was counted on "
        "across; what moved in between is not known. Record again without, or read what has none, "
        f"--rows {edges[longest] + 1}:{edges[longest + 1]}."
    )
    mended = position - np.concatenate([[0.0], np.cumsum(off)])
    mended.setflags(write=False)
    return mended, (Notice("warning", "jumps", text),)


def _caught_up(size: Floats, jumps: Bools) -> Bools:
    """Jumps by which a reading that hung is back where the device has gone since, shape (N - 1,).

    Over all of the rows in which nothing was read they are no farther than steps beside these.
    """
    found, moved = np.zeros_like(jumps), np.flatnonzero(size)
    for jump in map(int, np.flatnonzero(jumps)):
        before = int(moved[max(int(np.searchsorted(moved, jump)) - 1, 0)])
        rows = jump - before
        if 1 < rows <= HUNG:
            sides = slice(max(before - _AROUND + 1, 0), before + 1), slice(jump + 1, jump + _AROUND)
            farthest = max(float(size[side].max(initial=0.0)) for side in sides)
            found[jump] = size[jump] <= rows * _FARTHER * farthest
    return found


def _bits(counts: float, most: float) -> int:
    """Of the counter that jumps by so many counts, up to `most`; 0 where none does."""
    bits = round(math.log2(counts))
    return bits if bits >= _FEWEST_BITS and abs(2**bits - counts) < most else 0


def _by_a_turn(angle: Floats, steps: Floats) -> Bools | None:
    """Where an angle jumps by a turn; None without any such jump.

    Jumps are by a turn where the angle stays within one, nothing else jumps by half of one, and
    what is left of each without the turn is a step as elsewhere. No device turns by half a turn
    between two samples: a reading that falls out does, and comes back by the same way.
    """
    jumps = np.abs(steps) > _TURN / 2
    if not jumps.any() or jumps.all():
        return None
    most = _most(steps[~jumps])
    left = np.abs(steps[jumps] - _TURN * np.sign(steps[jumps]))
    return None if np.ptp(angle) > _TURN + most or left.max() > most else jumps


def _from_end_to_end(position: Floats, steps: Floats) -> tuple[Bools, float, float] | None:
    """Where a position jumps over all of its range, by how much, and what steps are elsewhere.

    A reading that falls out leaves from anywhere, and a new zero leads anywhere.
    """
    if np.count_nonzero(steps) < _FEWEST_STEPS:
        return None
    span = float(np.ptp(position))
    jumps = np.abs(steps) > span / 2
    if not jumps.any():
        return None
    most = _most(steps[~jumps])
    ends = np.stack([position[:-1][jumps], position[1:][jumps]])
    apart = np.minimum(ends - position.min(), position.max() - ends)
    if not 0 < most < _OF_RANGE * span or apart.max() > most:
        return None
    return jumps, float(np.median(np.abs(steps[jumps]))), most


def _most(steps: Floats) -> float:
    """How far a fast step goes; zero where nothing moves."""
    moves = np.abs(steps[steps != 0])
    return _STEPS * float(np.quantile(moves, 0.95)) if len(moves) else 0.0


def _note(what: str, jumps: Bools) -> Notice:
    text = (
        f"{what} {_times(jumps)}, the first time at {_first(jumps)}: it was counted on across it."
    )
    return Notice("note", "columns", text)


def _times(jumps: Bools) -> str:
    count = int(np.count_nonzero(jumps))
    return "once" if count == 1 else f"{count} times"


def _first(jumps: Bools) -> str:
    return f"row {int(np.flatnonzero(jumps)[0]) + 2}"
