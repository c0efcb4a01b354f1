"""Positions that begin again: angles after a turn, counters after their last count, new zeros."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.signals.filling import ORDER, TINY, fit_predictor
from bayeshaptic.recordings.signals.lone import AROUND, FARTHER
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rows.runs import HUNG_S
from bayeshaptic.types import Bools, Floats, Ints

_TURN = 2 * np.pi
# How far from a turn a jump may be, in fast steps elsewhere: what moves goes on across it.
_STEPS = 5.0
_OF_RANGE = 0.02  # five such steps are less than this share of the range
_FEWEST_BITS = 6  # of a counter
_FEWEST_STEPS = 100  # that tell what usual ones are
_FEWEST_JUMPS = 3  # fewer may lead from one place of work to another
# Counts that a jump to anywhere is farther than, which an encoder at rest does not flicker by; and
# `FARTHER` than any of the steps `AROUND` it.
_COUNTS = 20
_MOST_OFTEN = 1e-3  # of all rows: what moves so more often is how it moves
# Mean square of what the motion after a jump is off from what the motion before leads to expect,
# over the worst beside it, from where on it is another motion. Of 138 simulated recordings of all
# kinds, loops too, whose encoder is set to zero up to three times, two are above.
_ANOTHER = 6.0
_MEANS = 1, 4, 16  # rows


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


def without_jumps(
    position: Floats, force: Floats, period_s: float
) -> tuple[Floats, tuple[int, ...], tuple[Notice, ...]]:
    """The position without jumps to anywhere, where other motions begin, and a warning of them.

    No mass goes in one period eight times as far as in any of the ten before and after. Where the
    motion goes on after a jump, an encoder was set to zero or missed counts: it is counted on
    across. Where another motion begins, what stands on both sides was not recorded in one go. A
    reading that hung, and is back where the device has gone since, is for those who fill it in.

    Parameters
    ----------
    position, force : ndarray, shape (N,)
    period_s : float

    Returns
    -------
    position : ndarray, shape (N,)
    joints : tuple of int
        Samples at which another motion begins.
    notices : tuple of Notice
    """
    steps = np.diff(position)
    count = increment_unit(position) or 0.0
    jumps = _to_anywhere(steps, count)
    jumps[[rows.stop - 1 for rows in _hung(position, jumps, period_s)]] = False
    if not 0 < np.mean(jumps) <= _MOST_OFTEN:
        return position, (), ()
    beside = np.pad(steps, 1)
    off = np.where(jumps, steps - (beside[:-2] + beside[2:]) / 2, 0.0)
    if count:
        off = count * np.round(off / count)
    first = np.flatnonzero(jumps) + 1
    mended = position - np.concatenate([[0.0], np.cumsum(off)])
    # Where one is the beginning of another recording, so are the others, as far as anybody knows.
    another = first if _surprise(mended, force, first, count) > _ANOTHER else first[:0]
    off[another - 1] = 0.0  # how far one recording lies from the next nothing tells
    mended = position - np.concatenate([[0.0], np.cumsum(off)])
    mended.setflags(write=False)
    return mended, tuple(map(int, another)), (_told(steps, jumps, another),)


def hung(position: Floats, period_s: float) -> list[slice]:
    """Rows that repeat the one before until a jump to where the device has gone since.

    Parameters
    ----------
    position : ndarray, shape (N,)
    period_s : float
    """
    jumps = _to_anywhere(np.diff(position), increment_unit(position) or 0.0)
    return _hung(position, jumps, period_s)


def _to_anywhere(steps: Floats, count: float) -> Bools:
    """Steps that are farther than any around them, so that no mass goes so, shape (N - 1,)."""
    if np.count_nonzero(steps) < _FEWEST_STEPS:
        return np.zeros(len(steps), dtype=bool)
    size = np.abs(steps)
    # The most of ten steps: those before step k begin at its own place, those after ten further on.
    most = sliding_window_view(np.pad(size, AROUND), AROUND).max(axis=1)
    around = np.maximum(most[: len(steps)], most[AROUND + 1 :])
    return np.asarray(size > np.maximum(FARTHER * around, max(_most(steps), _COUNTS * count)))


def _surprise(position: Floats, force: Floats, first: Ints, count: float) -> float:
    """How far the motion from any of these rows on is off from what the motion before leads to.

    The mean square of the errors of predictions from both sides of a jump, over the usual one; of
    means over more and more rows, too: behind a coarse encoder few rows tell no velocity.

    Parameters
    ----------
    position, force : ndarray, shape (N,)
    first : ndarray of int
    count : float
        Of the encoder, which rounds the position; 0 where it is not known.
    """
    found = [0.0]
    for rows in _MEANS:
        blocks = len(position) // rows
        moved, pushed = (
            signal[: blocks * rows].reshape(blocks, rows).mean(axis=1)
            for signal in (position, force)
        )
        jumped = np.unique(first // rows)
        after = np.zeros(blocks, dtype=bool)
        after[jumped[jumped < blocks]] = True  # no regression across a jump
        predictor = fit_predictor(moved, pushed, after)
        if predictor is None:
            break
        errors = predictor.errors(moved, pushed)
        least = max(count**2 / 12 / rows, (TINY * float(np.std(position))) ** 2)
        everywhere = _mean_squares(errors, range(0, blocks - ORDER + 1, ORDER))
        # What the jump was, and where in its block, is not known: it is what leaves least.
        jump = np.stack([predictor.past[:ORDER], np.cumsum(predictor.past[:ORDER])], axis=1)
        for block in map(int, jumped[jumped + ORDER <= blocks]):
            left = errors[block : block + ORDER]
            left = left - jump @ np.linalg.lstsq(jump, left, rcond=None)[0]
            # A sweep, a hand or an end stop is harder to predict at one time than at another.
            beside = _mean_squares(errors, (block + k * ORDER for k in (-2, -1, 1, 2)))
            usual = max(float(np.median(everywhere)), max(beside, default=0.0), least)
            found.append(float(np.mean(left**2)) / usual)
    return max(found)


def _mean_squares(errors: Floats, begin: Iterable[int]) -> list[float]:
    """Mean squares of errors in stretches that begin so, of those that are whole."""
    return [
        float(np.mean(errors[row : row + ORDER] ** 2))
        for row in begin
        if 0 <= row <= len(errors) - ORDER
    ]


def _told(steps: Floats, jumps: Bools, another: Ints) -> Notice:
    """A warning of jumps, of which at some rows another motion begins."""
    said = (
        f"The position jumps {_times(jumps)}, the first time at {_first(jumps)} by "
        f"{steps[jumps][0]:.4g}, farther than in any step around it"
    )
    across = "an encoder was set to zero or missed counts. It was counted on across"
    if len(another):
        text = (
            f"{said}, and the motion does not go on from there as it was: several recordings stand "
            f"in one file, or rows were lost. They are read as {len(another) + 1} pieces, each by "
            "itself; report on each recording that should count alone with --rows."
        )
        return Notice("warning", "jumps", text)
    edges = np.concatenate([[0], np.flatnonzero(jumps) + 1, [len(jumps) + 1]])
    longest = int(np.argmax(np.diff(edges)))
    text = (
        f"{said}, and the motion goes on: {across}; what moved in between is not known. Record "
        f"again without, or read what has none, --rows {edges[longest] + 1}:{edges[longest + 1]}."
    )
    return Notice("warning", "jumps", text)


def _hung(position: Floats, jumps: Bools, period_s: float) -> list[slice]:
    """Rows before some of the `jumps`, shape (N - 1,), in which nothing was read.

    The jump is no farther than some times what it goes beside them in as many rows. Behind a coarse
    encoder a slow motion hangs for a while between any two counts.
    """
    found, moved = [], np.flatnonzero(np.diff(position))
    for jump in map(int, np.flatnonzero(jumps)):
        before = int(moved[max(int(np.searchsorted(moved, jump)) - 1, 0)])
        rows = jump - before
        if 1 < rows <= round(HUNG_S / period_s):
            sides = (
                position[max(before - rows + 1, 0) : before + 1],
                position[jump + 1 : jump + 1 + rows],
            )
            farthest = max(float(np.ptp(side)) for side in sides if len(side))
            if abs(position[jump + 1] - position[jump]) <= FARTHER * farthest:
                found.append(slice(before + 2, jump + 1))
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
