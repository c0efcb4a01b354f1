"""Samples that repeat the one before although the device moved on."""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis.samples.prediction import Samples
from bayeshaptic.recordings.signals.rows.runs import HUNG_S, runs
from bayeshaptic.recordings.signals.turns import hung
from bayeshaptic.types import Bools, Floats, Ints


def held(samples: Samples) -> tuple[Bools, float]:
    """Repeated samples that are not where all others say that the device was.

    Obvious ones first; without them the prediction is better and finds more.

    Returns
    -------
    wrong : ndarray of bool, shape (N,)
    statistic : float
        How many there are, less those samples that are as far off without repeating anything.
    """
    position = samples.recording.position
    steps = np.diff(position, prepend=position[0])
    repeated = (steps == 0) & (np.arange(len(steps)) > 0) & ~samples.missing
    ends = _in_a_leap(samples, steps, repeated)
    if samples.predictor is None:
        return np.zeros_like(repeated), 0.0
    units = 1.5  # increments a sample that no rounding turns into zero
    spreads = 4.0  # nor the noise
    fast = max(units * samples.unit, spreads * samples.predictor.spread)
    wrong = _obvious(position, fast)
    for rows in hung(position, samples.recording.period_s):
        wrong[rows] = True
    wrong &= repeated
    errors = 5.0  # how far off a repeated sample must be, in errors of the prediction
    rounds = 6
    for _ in range(rounds):
        trial = samples.without(_to_their_ends(wrong, ends))
        if trial.predictor is None:
            return np.zeros_like(repeated), 0.0
        limit = errors * trial.predictor.spread
        off = np.abs(trial.errors) > limit
        more = repeated & off & ~wrong
        if not more.any():
            break
        wrong |= more
    # What was filled in must be elsewhere, too; a device that rests is not.
    confirmed = 0.6  # of that, how far the filled-in position must lie from the repeated one
    filled, away = _to_their_ends(wrong, ends), trial.position - position
    filled &= _rms_of_runs(away, filled) > confirmed * limit
    elsewhere = filled & (np.abs(away) > confirmed * limit)
    return filled, float(elsewhere.sum() - np.sum(off & ~repeated))


def _in_a_leap(samples: Samples, steps: Floats, repeated: Bools) -> tuple[Ints, Ints]:
    """Runs of repeated samples that end in a leap, as `runs` gives them.

    A device that rested, for longer, leaves by a count.
    """
    first, stop = runs(repeated)
    leaps = np.append(np.abs(steps) > 1.5 * samples.unit, False)[stop]
    short = stop - first <= round(HUNG_S / samples.recording.period_s)
    return first[leaps & short], stop[leaps & short]


def _to_their_ends(wrong: Bools, ends: tuple[Ints, Ints]) -> Bools:
    """Wrong samples, and those behind them in runs in which nothing was read.

    One that is where the device was again by chance looks right, and so do the last, to which what
    is filled in before them is led. As true ones they would lead it there, however far the device
    has gone.
    """
    found = wrong.copy()
    for a, b in zip(*ends, strict=True):
        if wrong[a:b].any():
            found[a + int(np.argmax(wrong[a:b])) : b] = True
    return found


def _rms_of_runs(values: Floats, flags: Bools) -> Floats:
    """Of each run of flags its root mean square, at all of its samples; zero elsewhere, (N,)."""
    found = np.zeros_like(values)
    for a, b in zip(*runs(flags), strict=True):
        found[a:b] = np.sqrt(np.mean(values[a:b] ** 2))
    return found


def _obvious(position: Floats, fast: float) -> Bools:
    """Runs of equal samples in the middle of a fast motion that goes on as before."""
    first, last = runs(np.diff(position) == 0)  # of the equal samples
    inner = (first >= 3) & (last + 4 < len(position))
    first, last = first[inner], last[inner]
    speed = (position[first] - position[first - 3] + position[last + 4] - position[last + 1]) / 6
    with np.errstate(divide="ignore", invalid="ignore"):
        caught_up = (position[last + 1] - position[last]) / ((last - first + 1) * speed)
    sure = (np.abs(speed) > fast) & (caught_up > 0.5) & (caught_up < 1.5)
    changes = np.zeros(len(position) + 1)
    np.add.at(changes, first[sure] + 1, 1)
    np.add.at(changes, last[sure] + 1, -1)
    return np.cumsum(changes)[:-1] > 0
