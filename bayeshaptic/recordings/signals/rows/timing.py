"""The sampling period from time stamps, and whether the samples are evenly spaced."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError, Notice, such
from bayeshaptic.types import Floats

# Standard deviation of the time steps over the period: at 10 % the error at a tenth of the Nyquist
# frequency is 3 % of the signal, more than any device can be known to.
MOST_JITTER = 0.1
_USUAL = 0.6745  # median distance from the mean, over the standard deviation, of normal numbers
_LATEST = 1e100  # s: a later stamp is damage, even in ns since 1970, and its square is no number
# Rows that are missing in one place, and the share of all that are, up to which they are put back:
# of a force that nobody knows for longer than this its own past says nothing.
LONGEST_GAP, MOST_MISSING = 8, 0.01
_WORTH_READING = 1000  # rows, about what a response can be read from
_TIMER_BITS = 16, 24, 32
LOOP = "loop"  # what a warning of the topic "period" is about, where it doubts the loop's period
AGREE = 0.01  # relative: how far the stamps' period may lie from the one that was given
NOTABLE_JITTER = 0.005  # of the stamps: from here on worth a warning


def unusual_period(period_s: float) -> str | None:
    """What to say of a sampling period that no haptic loop has; None of another."""
    if 2e-6 < period_s < 0.1:
        return None
    return (
        f"the sampling period is {period_s:g} s, which no haptic loop has: is the time in ms or "
        "us? Write time=NAME[ms] or time=NAME[us] in --columns, or give --period-s in seconds"
    )


@dataclass(frozen=True)
class Timing:
    """What the time stamps say.

    Attributes
    ----------
    period_s : float
        The sampling period.
    jitter : float or None
        That of the time steps over the period, as a standard deviation; zero of an even clock's
        stamps, rounded; None without stamps.
    notices : tuple of Notice
    rows : ndarray of int, shape (N,), or None
        The place of each sample on the clock, where a few in between are missing.
    """

    period_s: float
    jitter: float | None = None
    notices: tuple[Notice, ...] = ()
    rows: NDArray[np.intp] | None = None


def sampling_period(
    time_s: Floats | None, period_s: float | None = None, where: str = "recording"
) -> Timing:
    """The period that the time stamps show, or the one that was given.

    A given period is believed: what contradicts it in the stamps becomes a warning. Without one,
    stamps that run back, leave long gaps or many, or are uneven are errors.

    Parameters
    ----------
    time_s : ndarray, shape (N,), or None
        Time stamps in seconds.
    period_s : float or None
    where : str
        Beginning of messages.

    Raises
    ------
    InputError
        For an impossible period, or stamps of no even sampling and no period (rows count from 1).
    """
    period_s = None if period_s is None else float(period_s)
    if period_s is not None and not (np.isfinite(period_s) and period_s > 0):
        raise InputError(f"{where}: the period must be a number of seconds above 0, not {period_s}")
    if time_s is None:
        if period_s is None:
            raise InputError(
                f"{where}: no time and no period; name the time with --columns time=NAME "
                "or give the sampling period with --period-s"
            )
        return Timing(float(period_s))
    time_s, counted = counted_on(time_s)
    if period_s is None:
        timing = _from_stamps(time_s, where)
        return replace(timing, notices=(*counted, *timing.notices))
    try:
        stamps = _from_stamps(time_s, where)
    except InputError as error:
        text = f"{error}. The period given, {period_s:g} s, is used and the time stamps are not."
        return Timing(float(period_s), None, (Notice("warning", "time stamps", text),))
    if abs(stamps.period_s / period_s - 1) > AGREE:
        text = (
            f"The time stamps show a period of {stamps.period_s:.6g} s; the period given, "
            f"{period_s:g} s, is used."
        )
        return Timing(float(period_s), stamps.jitter, (Notice("warning", "time stamps", text),))
    return Timing(float(period_s), stamps.jitter, counted)


def counted_on(time_s: Floats) -> tuple[Floats, tuple[Notice, ...]]:
    """The stamps of a timer that begins again after 2^16, 2^24 or 2^32 ticks, counted on; a note.

    What each step back lacks of a usual one is the timer's range. Recordings that stand one after
    the other begin at one time each, and are left as they are.
    """
    steps = np.diff(time_s)
    back = np.flatnonzero(steps < 0)
    tick = _rounding(time_s) if len(back) and time_s.min() >= 0 else 0.0
    if not tick or np.all(time_s[back + 1] == time_s[0]):
        return time_s, ()
    usual = float(np.median(steps))
    for bits in _TIMER_BITS:
        lacks = usual - steps[back] - 2**bits * tick
        if np.all(np.abs(lacks) < 0.5 * usual) and time_s.max() < 2**bits * tick:
            turns = np.cumsum(np.append(0, steps < 0))
            text = (
                f"The time begins again after {2**bits:,} ticks of {tick:g} s, as a timer of "
                f"{bits} bits does, the first time at row {back[0] + 2}: it was counted on."
            )
            return time_s + 2**bits * tick * turns, (Notice("note", "time stamps", text),)
    return time_s, ()


def _only_out_of_turn(time_s: Floats, period: float) -> bool:
    """Whether stamps are those of every row, a few of which stand some rows early or late."""
    order = np.argsort(time_s, kind="stable")
    far = int(np.max(np.abs(order - np.arange(len(order)))))
    return far <= LONGEST_GAP and bool(np.all(np.diff(time_s[order]) > 0.5 * period))


def _from_stamps(time_s: Floats, where: str) -> Timing:
    if len(time_s) < 3:
        raise InputError(f"{where}: {len(time_s)} time stamps; a period needs at least 3")
    bad = np.flatnonzero(~(np.abs(time_s) < _LATEST))
    if len(bad):
        raise InputError(f"{where}: the time in row {bad[0] + 1} is {time_s[bad[0]]}")
    slope, scatter = _clock(time_s)
    if slope > 0 and scatter <= max(0.75 * _rounding(time_s), 0.6 * _grid(time_s, slope)):
        return Timing(slope, 0.0)
    steps = np.diff(time_s)
    period = float(np.median(steps))
    # The usual step, before the few that are odd: where that varies, nothing is missing.
    usual = float(np.median(np.abs(steps - period))) / _USUAL
    if period > 0 and usual > MOST_JITTER * period:
        # Gaps are in the standard deviation, too.
        raise InputError(_uneven(where, steps, min(usual, float(np.std(steps))) / period))
    if not period and not np.any(steps < 0):
        raise InputError(
            f"{where}: most rows have the time of the row before them: the stamps are too coarse "
            "to tell the period; give it with --period-s"
        )
    _refuse_standing_or_back(time_s, steps, period, where)
    gaps = _gaps(time_s, period)
    if len(gaps):
        return _with_gaps(time_s, gaps, period, where)
    jitter = float(np.std(steps)) / period
    if jitter > MOST_JITTER:
        raise InputError(_uneven(where, steps, jitter))
    return Timing(slope, jitter)


def _refuse_standing_or_back(time_s: Floats, steps: Floats, period: float, where: str) -> None:
    """Refuse stamps of which some do not advance, by what they look like."""
    back = np.flatnonzero(steps <= 0)
    several = 3  # rows of the time of the row before: a logger that writes rows twice
    if len(back) >= several and np.all(steps[back] == 0):
        raise InputError(
            f"{where}: {len(back)} rows have the time of the row before them, the first is row "
            f"{back[0] + 2} ({time_s[back[0]]:.9g} s): are they in the file twice? Remove them"
        )
    if len(back) and _only_out_of_turn(time_s, period):
        raise InputError(
            f"{where}: rows stand out of turn, as a network may deliver them: row {back[0] + 2} "
            f"({time_s[back[0] + 1]:.9g} s) after {time_s[back[0]]:.9g} s "
            f"({such(len(back), 'place')}); sort the rows by their time"
        )
    if len(back):
        raise InputError(
            f"{where}: time does not advance from row {back[0] + 1} to row {back[0] + 2} "
            f"({time_s[back[0]]:.9g} s, {time_s[back[0] + 1]:.9g} s; {such(len(back), 'place')}); "
            "cut the recording there, or give the period with --period-s if only the stamps are "
            "wrong"
        )


def _uneven(where: str, steps: Floats, jitter: float) -> str:
    return (
        f"{where}: time steps are not even: they vary by {100 * jitter:.0f} % (standard "
        f"deviation), from {steps.min():.6g} s to {steps.max():.6g} s; resample to an even "
        "period, or give the period with --period-s if only the stamps are wrong"
    )


def _clock(time_s: Floats) -> tuple[float, float]:
    """Slope of the straight line through the stamps, and the largest distance from it.

    Where several rows share a stamp, the line goes through the first row of each: a line through
    all of a stair's rows is too flat, by 1 % where ten seconds are stamped in whole ones. Zero
    where fewer than two stamps begin within the recording.
    """
    index = np.arange(len(time_s)) - (len(time_s) - 1) / 2
    centred = time_s - time_s.mean()
    begins = np.flatnonzero(np.diff(time_s)) + 1  # the first stamp's own may be cut off
    if len(begins) == len(time_s) - 1:
        begins = np.arange(len(time_s))
    if len(begins) < 2:
        return 0.0, float("inf")
    at = index[begins] - index[begins].mean()
    slope = float(at @ centred[begins] / (at @ at))
    # Nine digits: more is rounding, and 0.001 is what people expect to read.
    slope = float(f"{slope:.9g}")
    return slope, float(np.abs(centred - slope * index).max())


def _rounding(time_s: Floats) -> float:
    """The power of ten to which the stamps were rounded; zero where there is none."""
    # What double precision itself leaves of a decimal number.
    dust = 4 * np.finfo(float).eps * float(np.abs(time_s).max())
    for digits in range(10):
        scaled = (time_s - time_s[0]) * 10.0**digits
        tolerance = 1e-6 + dust * 10.0**digits
        if tolerance < 0.05 and np.abs(scaled - np.round(scaled)).max() < tolerance:
            return float(10.0**-digits)
    return 0.0


def _grid(time_s: Floats, slope: float) -> float:
    """What stamps of few digits, as of single precision, were rounded to; zero where to nothing.

    Steps then have two to four lengths, one grid apart.  A grid as long as the period is that of
    every clock, of which gaps are multiples.  None of 2,000 simulated clocks with jitter, late
    stamps or gaps is taken for one.
    """
    steps = np.sort(np.diff(time_s))
    jumps = np.diff(steps)
    apart = float(jumps.max())
    edges = np.flatnonzero(jumps > 0.5 * apart)
    groups = np.split(steps, edges + 1)
    middles = np.diff([np.mean(group) for group in groups])
    tight = max(float(np.ptp(group)) for group in groups) < 0.2 * apart
    even = np.all(np.abs(middles / apart - 1) < 0.2)
    # Gaps are of few steps.
    often = 2 <= len(groups) <= 4 and min(map(len, groups)) > 0.02 * len(steps)
    if steps[0] < 0 or not (often and tight and even) or 0.6 < apart / slope < 1.2:
        return 0.0
    return float(np.mean(middles))


def _gaps(time_s: Floats, period: float) -> NDArray[np.intp]:
    """Samples after which some are missing; a late stamp that the next step makes up for is no gap.

    Where many steps are long, and of no whole number of periods, it is uneven sampling and no gap.
    """
    steps = np.diff(time_s)
    pairs = np.append(time_s[2:] - time_s[:-2], np.inf)
    gaps = np.flatnonzero((steps > 1.5 * period) & (pairs > 2.5 * period))
    turns = steps[gaps] / period
    whole = np.all(np.abs(turns - np.rint(turns)) < MOST_JITTER)
    return gaps if whole or len(gaps) <= max(3, len(steps) // 100) else gaps[:0]


def _with_gaps(time_s: Floats, gaps: NDArray[np.intp], period: float, where: str) -> Timing:
    """The period of stamps with short gaps, and which rows there are; long gaps are refused."""
    steps = np.diff(time_s)
    lost = np.zeros(len(time_s), dtype=np.intp)
    lost[gaps + 1] = np.maximum(np.rint(steps[gaps] / period) - 1, 1)
    count = int(lost.sum())
    if lost.max() > LONGEST_GAP or count > MOST_MISSING * len(time_s):
        first = gaps[0]
        edges = np.concatenate([[0], gaps + 1, [len(time_s)]])
        longest = int(np.argmax(np.diff(edges)))
        start, end = edges[longest] + 1, edges[longest + 1]
        cure = (
            f"read it alone with --rows {start}:{end}"
            if end - start >= _WORTH_READING
            else "too few to read, so record again with a logger that keeps up"
        )
        raise InputError(
            f"{where}: about {steps[first] / period - 1:.0f} samples are missing after row "
            f"{first + 1} (a step of {steps[first]:.6g} s where the period is {period:.6g} s; "
            f"{such(len(gaps), 'place')}); the longest part without a gap is rows {start} to "
            f"{end}: {cure}"
        )
    rows = np.arange(len(time_s)) + np.cumsum(lost)
    even = _from_stamps(np.interp(np.arange(rows[-1] + 1), rows, time_s), where)
    text = (
        f"{count} rows ({100 * count / len(time_s):.2g} %) are missing by their time stamps, "
        f"{int(lost.max())} at most in one place, the first after row {gaps[0] + 1}: they were put "
        "back as the rows around them lead to expect."
    )
    notices = (*even.notices, Notice("note", "time stamps", text))
    return replace(even, notices=notices, rows=rows)
