"""Recordings that stand one after the other in one file, by their time stamps.

A file of several runs has a step of seconds between them, or its time begins again. What lies
between is not known, and what each run says of the device is: they are pieces, as those of several
files are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.signals.rows.timing import (
    AGREE,
    LONGEST_GAP,
    Timing,
    counted_on,
    sampling_period,
)
from bayeshaptic.types import Floats, Ints

# Shorter than this, a piece has too few lines for windows of its own.
FEWEST_SAMPLES = 250
# How far the periods of two pieces may lie apart: what clocks' stamps leave open.
_APART = 1e-3


@dataclass(frozen=True)
class Run:
    """Rows that follow each other on one clock.

    Attributes
    ----------
    rows : slice
        Of the file.
    timing : Timing
        What their time stamps say.
    """

    rows: slice
    timing: Timing


def runs_on_a_clock(
    time_s: Floats | None, samples: int, period_s: float | None, where: str
) -> tuple[tuple[Run, ...], tuple[Notice, ...]]:
    """The runs of a file, each with its own time stamps, and a note where it has several.

    One run, or none whose stamps are even by themselves, is what `sampling_period` makes of all.

    Parameters
    ----------
    time_s : ndarray, shape (N,), or None
    samples : int
        N.
    period_s : float or None
        As it was given.
    where : str
        Beginning of messages.

    Raises
    ------
    InputError
        See `sampling_period`.
    """
    begin = _begin(time_s)
    if time_s is not None and len(begin):
        edges = [0, *begin.tolist(), samples]
        found = [
            Run(slice(a, b), timing)
            for a, b in zip(edges[:-1], edges[1:], strict=True)
            if (timing := _by_itself(time_s[a:b], where)) is not None
        ]
        if len(found) == len(begin) + 1 and _alike(found, period_s):
            return tuple(found), (_told(time_s, begin, found),)
    return (Run(slice(0, samples), sampling_period(time_s, period_s, where)),), ()


def _begin(time_s: Floats | None) -> Ints:
    """Rows at which another run begins; none where one would be shorter than a piece.

    A time that runs back into the run before is that of rows that were written twice.
    A step of no time is one where the clock goes on as usual on both sides: a run that begins with
    the stamp that the one before ended with. Rows out of turn, and lone wrong stamps, are none.
    """
    nothing = np.zeros(0, dtype=np.intp)
    if time_s is None or len(time_s) < 2 * FEWEST_SAMPLES or not np.isfinite(time_s).all():
        return nothing
    steps = np.diff(counted_on(time_s)[0])
    period = float(np.median(steps))
    if not period > 0:
        return nothing
    usual = np.pad(np.abs(steps / period - 1) < 0.5, 1, constant_values=True)
    again = (steps == 0) & usual[:-2] & usual[2:]
    far = (steps > (LONGEST_GAP + 1.5) * period) | (steps < -LONGEST_GAP * period)
    begin = np.flatnonzero(far | again) + 1
    lengths = np.diff(begin, prepend=0, append=len(time_s))
    if not len(begin) or lengths.min() < FEWEST_SAMPLES:
        return nothing
    back = steps[begin - 1] < 0
    before = time_s[np.append(0, begin[:-1])]  # at which the run before began
    return nothing if np.any(time_s[begin[back]] > before[back] + 1.5 * period) else begin


def _by_itself(time_s: Floats, where: str) -> Timing | None:
    try:
        return sampling_period(time_s, None, where)
    except InputError:
        return None


def _alike(runs: list[Run], period_s: float | None) -> bool:
    """Whether all have one period, and that which was given."""
    periods = np.array([run.timing.period_s for run in runs])
    mean = float(np.median(periods))
    given = period_s is None or abs(mean / period_s - 1) <= AGREE
    return given and bool(np.all(np.abs(periods / mean - 1) <= _APART))


def _told(time_s: Floats, begin: Ints, runs: list[Run]) -> Notice:
    first = int(begin[0])
    step = float(time_s[first] - time_s[first - 1])
    what = f"goes on {step:.4g} s later" if step > 0 else f"begins again at {time_s[first]:.6g} s"
    longest = max((run.rows for run in runs), key=lambda rows: rows.stop - rows.start)
    text = (
        f"The time {what} at row {first + 1}, and {len(runs)} runs stand in the file: they are "
        "read as pieces of one recording, which is right where all are of one device, held alike. "
        f"The longest alone is --rows {longest.start + 1}:{longest.stop}."
    )
    return Notice("note", "time stamps", text)
