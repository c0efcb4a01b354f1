"""Whether rows lie unevenly in time, in a pattern that comes again and again."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import pure
from bayeshaptic.recordings.signals.filling import TINY, fit_predictor
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rows.timing import LOOP
from bayeshaptic.types import Floats

UNEVEN = "uneven rows"  # what its warning is about
_FEWEST_SAMPLES = 1000
_ROWS = 1, 4, 12  # that a velocity is a mean over: encoders' counts show none in few
_COUNTS = 1.5  # that the device moves by in as many rows (rms)
_AROUND, _MOST = 401, 5.0  # rows whose sizes a product is beside, and the most it counts by
_SLOWEST = 0.01  # cycles a row: slower ones are what a device does
_APART = np.linspace(0.083, 0.917, 16)  # of the recording, by which error and velocity are moved
# The height of the line, over the mean of all; how much higher than with both moved apart; and the
# least width, in rows, of a pattern that rows have, and not what filled them.  With these 0 of 393
# strangers and 0 of 305 recordings of a third simulation are called uneven, and 34 of 60 of the
# newest rows of a faster loop (docs/door.md); chosen on 30 of the latter, and on some strangers.
_LEAST, _HIGHER, _WIDE = 35.0, 5.0, 0.1


class _Pattern(NamedTuple):
    """How rows are early and late: how often, by how much, and how clearly.

    Attributes
    ----------
    frequency : float
        Cycles a row.
    width : float
        Rows, from the earliest to the latest.
    height, moved : float
        Of the line in the products of error and velocity, over their mean, and the highest at its
        place with errors and velocities moved apart.
    """

    frequency: float
    width: float
    height: float
    moved: float


def uneven_rows(force: Floats, position: Floats, period_s: float, stamped: bool) -> Notice | None:
    """A warning of rows that are early and late by turns; None where they are not.

    A row that is late shows the device where it is by then: what its past foretells of the position
    is off by the velocity times how late it is.  So that error, times a velocity of before, holds
    a line where rows are late in a pattern, and no other if the device is what it was.  Periodic
    motion, whose errors have lines of their own, holds it with errors and velocities moved apart,
    too.  A controller whose law is not the same at every row answers to the velocity by turns, and
    nothing here tells that from rows that are late (19 of 100 cascades of two rates).

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    period_s : float
        Of the rows.
    stamped : bool
        Whether time stamps say so: then ``--period-s`` can say that the loop has it, too.
    """
    if len(force) < _FEWEST_SAMPLES or np.ptp(position) == 0:
        return None
    found = _pattern(position, force)
    if found is None or found.height < _HIGHER * found.moved or found.width < _WIDE:
        return None
    text = (
        "Rows are not evenly apart in time, or a controller's outer loop runs at every few of them "
        "only: by turns, in a pattern that comes again and again, some look later than others by "
        f"{pure(min(found.width, 1.0), 1)} of a period or more, as where a log writes the newest "
        "row of a loop of another rate, rows are lost at regular times, or a recording was brought "
        "to another rate. Commands that are not written down then move the device, and what is "
        "seen of its delay and its noise is that of no loop. Write every row of the loop down"
    )
    if stamped:
        text += (
            f", or say --period-s {period_s:.6g} where the loop runs at every row, and its outer "
            "loop is slower, or the sensor of the position alone has another clock"
        )
    return Notice("warning", "period", f"{text}.", (LOOP, UNEVEN) if stamped else ())


def _pattern(position: Floats, force: Floats) -> _Pattern | None:
    """The clearest, by any of the velocities; None where there is none."""
    predictor = fit_predictor(position, force, np.zeros(len(position), dtype=bool))
    if predictor is None or predictor.spread <= TINY * np.std(position):
        return None
    errors = predictor.errors(position, force)
    error = np.clip(errors / predictor.spread, -_MOST, _MOST)
    # Of a position that moves by less than a count or two an error goes with the step before.
    count = increment_unit(position) or 0.0
    seen = [(rows, _velocity(position, rows)) for rows in _ROWS]
    velocities = [velocity for rows, velocity in seen if rows * velocity.std() > _COUNTS * count]
    if not velocities:
        return None
    lines = [_lines(error, _beside(velocity)) for velocity in velocities]
    clearest = int(np.argmax([line.max() for line in lines]))
    velocity, heights = velocities[clearest], lines[clearest]
    beside = _beside(velocity)
    best = int(np.argmax(heights))
    if heights[best] < _LEAST:
        return None
    near = slice(max(best - 2, 0), best + 3)
    periods = [_again(signal) for signal in (beside, error, force - force.mean())]
    shifts = [*periods, *(_APART * len(error)).astype(int)]
    moved = max(float(_lines(error, np.roll(beside, shift))[near].max()) for shift in shifts)
    frequency = best / (2 * (len(heights) - 1))
    # A row that is late by a part of a period leaves an error of so many steps, after what the
    # predictor makes of rows that were late before. Of a saw-tooth, as this pattern is, the first
    # harmonic is its width over 2 pi.
    turning = np.exp(-2j * np.pi * frequency * np.arange(len(errors)))
    late = np.sum(errors * velocity * turning) / max(velocity @ velocity, np.finfo(float).tiny)
    passed = predictor.past @ turning[: len(predictor.past)]
    width = float(2 * np.pi * abs(late) / abs(passed))
    return _Pattern(frequency, width, float(heights[best]), moved)


def _velocity(position: Floats, rows: int) -> Floats:
    """The mean of as many steps before each sample, per row; zero at the first ones."""
    velocity = np.zeros(len(position))
    velocity[rows + 1 :] = (position[rows:-1] - position[: -rows - 1]) / rows
    return velocity


def _beside(velocity: Floats) -> Floats:
    """Each velocity over those around it."""
    from scipy.ndimage import uniform_filter1d

    usual = np.sqrt(np.maximum(uniform_filter1d(velocity**2, _AROUND), 0))
    least = 1e-3 * velocity.std() + np.finfo(float).tiny
    return np.clip(velocity / (usual + least), -_MOST, _MOST)


def _again(signal: Floats) -> int:
    """After how many rows it is most like itself, a period where it has one."""
    from scipy.signal import correlate

    like = np.abs(correlate(signal, signal, method="fft")[len(signal) - 1 :])
    lags = slice(_AROUND, len(signal) // 2)
    overlap = len(signal) - np.arange(len(signal))
    return _AROUND + int(np.argmax(like[lags] / overlap[lags]))


def _lines(error: Floats, beside: Floats) -> Floats:
    """Power of their products at frequencies up to half a cycle a row, over its mean."""
    from scipy.fft import next_fast_len, rfft

    product = error * beside
    product -= product.mean()
    length = 2 * next_fast_len(len(error), real=True)
    power: Floats = np.abs(rfft(product, length)) ** 2
    power[: int(np.ceil(_SLOWEST * length))] = 0.0
    return power / max(float(product @ product), np.finfo(float).tiny)
