"""Runs of true values, and of rows that are alike, as where a log is faster than the loop."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.signals.rows.timing import LOOP
from bayeshaptic.types import Bools, Floats, Ints

# Seconds that a reading hangs for at most; a device that rests does so for longer. Of 300 that hang
# for 0.02 to 0.25 s, at 0.25 to 10 kHz, none is taken for a jump (of 250 rows at most 88 were, all
# above 1 kHz); of longer ones only what looks wrong is filled in.
HUNG_S = 0.25
_FEWEST_CHANGES = 100
_FEWEST_AT_REST, _LEAST_AT_REST = 100, 0.02  # rows of a standstill, and their share
_AS_FAR = 0.5  # as a force pushes a mass where it moves; under less a device may just rest
_MOST_TIMES = 20  # that a row is written
# Two clocks that beat are seen by changes of the signal at a steady mean distance in rows: at most
# so many rows a change (beyond that `held_for` allows for slips), so many beats in a block of
# changes, so many blocks, this share of them alike to a row, and steps that scatter by this share
# of their mean (a ramp in counts of a converter does not scatter).  Of 488 recordings 20 show it,
# all of which have such a clock; those that are missed: docs/door.md.
_MOST_UNEVEN, _BEATS, _FEWEST_BLOCKS, _MOSTLY, _STEPS_VARY = 4.0, 8, 10, 0.9, 0.1
# Chance that a position would stand by itself wherever the force does; and how many rows two
# oscillators drift apart at most.
_BY_CHANCE, _OFF = 1e-9, 3.0


def runs(flags: Bools) -> tuple[Ints, Ints]:
    """First index of each run, and the one behind its last; shape (R,) each.

    Parameters
    ----------
    flags : ndarray of bool, shape (N,)
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return edges[::2], edges[1::2]


def longest(flags: Bools) -> tuple[int, int]:
    """The same of the longest run, the first of equal ones; (0, 0) where there is none.

    Parameters
    ----------
    flags : ndarray of bool, shape (N,)
    """
    starts, stops = runs(flags)
    if len(starts) == 0:
        return 0, 0
    most = int(np.argmax(stops - starts))
    return int(starts[most]), int(stops[most])


def written_each(signals: Sequence[Floats]) -> tuple[int, int]:
    """How often each row is written, as where a log is faster than its loop; and the first new row.

    Every signal changes at every n-th row alone, a hundred times at least: none of 200 simulated
    open and closed loops does.

    Parameters
    ----------
    signals : sequence of ndarray, shape (N,)

    Returns
    -------
    tuple of int
        (1, 0) where rows differ.
    """
    changes = [1 + np.flatnonzero(np.diff(signal)) for signal in signals]
    if min(len(at) for at in changes) < _FEWEST_CHANGES:
        return 1, 0
    for often in range(_MOST_TIMES, 1, -1):
        first = int(changes[0][0] % often)
        if all(np.all(at % often == first) for at in changes):
            return often, first
    return 1, 0


def held_for(signal: Floats) -> int:
    """For how many rows a signal is held, as by a clock that is slower than that of the rows.

    Between two of its changes lie that many rows, or a multiple where it comes back to the same
    value; a row more or fewer of four and more, where the two clocks are not of one oscillator.  A
    square wave, as a relay's, that has two levels in turns is none.

    Parameters
    ----------
    signal : ndarray, shape (N,)

    Returns
    -------
    int
        1 where it is not.
    """
    apart = np.diff(np.flatnonzero(np.diff(signal)))
    if len(apart) < _FEWEST_CHANGES:
        return 1
    rows = int(np.median(apart))
    if not 1 < rows <= _MOST_TIMES:
        return 1
    times = np.rint(apart / rows)
    slips = 1 if rows >= 4 else 0
    clocked = (times >= 1) & (np.abs(apart - times * rows) <= slips)
    mostly, rarely = 0.98, 0.1  # of the changes
    square = len(np.unique(signal)) == 2 and np.mean(times > 1) < rarely
    return rows if np.mean(clocked) >= mostly and not square else 1


def held_unevenly(signal: Floats) -> float:
    """For how many rows a signal is held in the mean, by a clock that beats with that of the rows.

    As where a log of 1 kHz writes the newest command of a servo of 800 Hz: every fourth is written
    twice.  Any block of changes is then as long as any other to a row; what repeats by chance (a
    coarse converter, a force of few levels) is uneven.

    Parameters
    ----------
    signal : ndarray, shape (N,)

    Returns
    -------
    float
        1 where no such clock shows.
    """
    steps = np.diff(signal)
    at = np.flatnonzero(steps)
    if len(at) < _FEWEST_CHANGES:
        return 1.0
    rows = float((at[-1] - at[0]) / (len(at) - 1))
    beats = min(rows % 1, 1 - rows % 1)  # a change
    whole = int(rows)
    if not 1 < rows < _MOST_UNEVEN or beats == 0 or len(np.unique(signal)) == 2:
        return 1.0
    together = int(np.ceil(_BEATS / (beats * (1 - beats))))
    lengths = at[together:] - at[:-together]
    if len(at) < _FEWEST_BLOCKS * together:
        return 1.0
    apart = np.diff(at)
    even = (np.abs(lengths - together * rows) <= 1).mean()
    near = ((apart == whole) | (apart == whole + 1)).mean()
    size = np.abs(steps[at])
    vary = size.std() > _STEPS_VARY * size.mean()
    return rows if even >= _MOSTLY and near >= _MOSTLY and vary else 1.0


def new_rows(force: Floats, position: Floats, rows: float) -> Ints | None:
    """Rows at which a force that is held unevenly changes; None where the position goes on between.

    Then whole rows were written again, and these are the loop's own, unless the position stands so
    often that it may do so in all of these by chance, or one of the loop's forces was the same as
    the one before.

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    rows : float
        For how many the force is held in the mean.
    """
    again = np.diff(force) == 0
    alike = np.diff(position) == 0
    stands = float(np.mean(alike[~again]))
    new = np.flatnonzero(~again) + 1
    off = np.ptp(new - rows * np.arange(len(new)))
    if off > _OFF or not np.all(alike[again]) or stands ** np.sum(again) > _BY_CHANCE:
        return None
    return new


def moving_part(force: Floats, position: Floats, count: float) -> tuple[int, int]:
    """First row, and the one behind the last, without a standstill at either end.

    The position stays within a count and a half for longer than anywhere else, while the force goes
    on: as before an amplifier is switched on, and after it is switched off.  In each other part as
    long the device moves, under a force that pushes a mass hardly farther (the fast end of a sweep
    pushes it less far).

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    count : float
        Of the encoder; 0 where it is not known.
    """
    samples = len(position)
    away = [np.flatnonzero(np.abs(position - end) > 1.5 * count) for end in position[[0, -1]]]
    if not all(map(len, away)):
        return 0, samples
    first, stop = int(away[0][0]), int(away[1][-1]) + 1

    def is_one(rows: Floats) -> bool:
        length = len(rows)
        parts = (stop - first) // max(length, 1)
        if length < max(_FEWEST_AT_REST, _LEAST_AT_REST * samples) or parts < 2:
            return False
        moving = slice(first, first + parts * length)
        ways = np.ptp(position[moving].reshape(parts, length), axis=1)
        pushes = _pushes(force[moving].reshape(parts, length))
        # What acts in its last tenth alone may be what ends it: a pulse after a rest.
        acts = np.std(rows[: length - length // 10]) > _AS_FAR * np.std(force[moving])
        return bool(acts and ways.min() > 3 * count and _pushes(rows) > _AS_FAR * np.median(pushes))

    return (first if is_one(force[:first]) else 0, stop if is_one(force[stop:]) else samples)


def _pushes(force: Floats) -> Floats:
    """How far each part of a force, along the last axis, moves a mass back and forth."""
    for _ in range(2):
        force = np.cumsum(force - force.mean(axis=-1, keepdims=True), axis=-1)
    return np.ptp(force, axis=-1)


def rows_alike(often: float, period_s: float) -> Notice:
    """A note that every row stands several times in a row, in a loop of this period."""
    mean = "" if often % 1 == 0 else " in the mean"
    text = (
        f"Every row stands {often:.3g} times in a row{mean}, as where a log is faster than the "
        "loop: one of each was read, and the loop's period is taken to be "
        f"{quantity(period_s, 's')}. Say otherwise with --period-s, which is that of a row."
    )
    return Notice("note", "time stamps", text)


def force_held(force: Floats, rows: int, period_s: float, stamped: bool) -> Notice:
    """A warning of a loop of a longer period than the rows have, or an excitation that was held."""
    slower, each = quantity(rows * period_s, "s"), f"one row in {rows}"
    levels = len(np.unique(force)) > 2  # two are those of a clock that people choose
    cure = (
        f"Say which it is: --period-s {rows * period_s:.6g} for the loop of these changes, of "
        f"which {each} is then read, or --period-s {period_s:.6g} where the loop runs at every row "
        "and the excitation alone was held."
        if stamped
        else f"If so, keep {each} alone, those at which the force changes, and say the period of "
        "these."
    )
    text = (
        f"The force is held for {rows} rows, and the position changes in between: as where a drive "
        f"writes rows faster than its loop commands forces. That loop's period is {slower}, and "
        f"its limit is lower than that of one of {quantity(period_s, 's')}. {cure}"
    )
    return Notice("warning", "period", text, (LOOP,) if levels and stamped else ())


def force_held_unevenly(rows: float, period_s: float, stamped: bool) -> Notice:
    """A warning of a loop that runs at another rate than the rows, which no row is in time with."""
    text = (
        f"The force is held for {rows:.3g} rows in the mean, by a clock that beats with that of "
        f"the rows: as where a log writes the newest command of a loop of "
        f"{quantity(rows * period_s, 's')}, or a recording was brought to another rate afterwards. "
        f"Commands then stand up to {quantity(period_s, 's')} after their time, which looks like "
        "less delay than the loop has, and its limit is lower. Record the loop's own rows"
    )
    if stamped:
        text += (
            f", or say --period-s {period_s:.6g} where the loop runs at every row and the "
            "excitation alone was held"
        )
    return Notice("warning", "period", f"{text}.", (LOOP,) if stamped else ())


def position_held(rows: int, period_s: float) -> Notice:
    """A warning of a position that is read more slowly than forces are commanded."""
    text = (
        f"The position is held for {rows} rows, {quantity(rows * period_s, 's')}, while the force "
        "changes in between: as where it is read more slowly than forces are commanded. The limit "
        "is that of a loop that sees it so late. If the loop sees a new position at every row, "
        "record that one: then the limit is higher."
    )
    return Notice("warning", "held position", text)


def left_out(start: int, stop: int, samples: int) -> tuple[Notice, ...]:
    """A warning of rows left out before `start`, and from `stop` on; none where all are there."""
    ends = [f"{a + 1} to {b}" for a, b in ((0, start), (stop, samples)) if b > a]
    if not ends:
        return ()
    text = (
        f"The position stands still in rows {' and '.join(ends)} while the force goes on, as "
        "before an amplifier is switched on, after it is switched off, or behind a brake: these "
        "rows were left out."
    )
    return (Notice("warning", "standstill", text),)
