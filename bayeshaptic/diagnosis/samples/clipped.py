"""Positions that were cut off at the end of the sensor's range."""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.prediction import Samples
from bayeshaptic.recordings.signals.rows.runs import runs
from bayeshaptic.types import Bools, Floats

# A motion that comes from rest has gone a quarter of the way in half of the time; one that comes
# back over an extreme more than 0.4 of it, at a quarter of the time that it was beyond.
_FROM_REST = 0.35
# Of the runs of a position that was cut off; of noise up to 60 Hz half begin or end slowly.
_MOST_RESTS = 0.75
_QUIET = 0.5  # of the usual change from sample to sample: what a run on an extreme stays below


def clipped(samples: Samples) -> tuple[Bools, float]:
    """Samples on an extreme that, by all others, must have been beyond it.

    A motion that merely turns round stays on its last level for a while too, but does not lead
    beyond it; one that pauses there, held by a controller or by dry friction, comes to rest or
    leaves from rest under a force that hardly changes; one that was cut off passes the extreme at
    speed both ways.

    Returns
    -------
    wrong : ndarray of bool, shape (N,)
    statistic : float
        How far beyond the extreme the motion led, over the error of a prediction; infinite, with
        no sample wrong, where too few others are left to say what is.
    """
    position = samples.recording.position
    wrong, statistic = np.zeros(len(position), dtype=bool), 0.0
    extremes = [(+1, position == position.max()), (-1, position == position.min())]
    unit = samples.unit or 1e-3 * float(np.ptp(position))
    extremes = [
        (sign, there & ~at_rest(position, samples.recording.force, there, unit))
        for sign, there in extremes
    ]
    fewest = 4  # samples on an extreme that are worth a look
    extremes = [(sign, there) for sign, there in extremes if there.sum() >= fewest]
    levels = 4  # a position that takes fewer is none
    if not extremes or len(np.unique(position)) <= levels:
        return wrong, statistic
    at_extremes = np.any([there for _, there in extremes], axis=0)
    trial = samples.without(at_extremes)
    if trial.predictor is None:  # hardly anything is left to predict from
        return wrong, np.inf if at_extremes.mean() > 0.5 else 0.0
    error = max(trial.predictor.spread, 0.4 * samples.unit)
    inner = np.zeros_like(wrong)  # those between samples on both sides
    inner[trial.predictor.order : -trial.predictor.order] = True
    for sign, there in extremes:
        beyond = sign * (trial.position - position)[there & inner] / error
        if len(beyond) < fewest:
            continue
        beyond = np.sort(beyond)
        statistic = max(statistic, float(beyond[-fewest // 2]))
        if beyond[-fewest // 2] > thresholds.CLIPPED:
            wrong |= there
    return wrong, statistic


def at_rest(position: Floats, force: Floats, there: Bools, unit: float) -> Bools:
    """Samples of long runs on an extreme, where nearly all of these are pauses.

    In a pause the force hardly changes, and the motion before or after it begins at rest; a
    recording that begins or ends on an extreme rests there.

    Parameters
    ----------
    position, force : ndarray, shape (N,)
    there : ndarray of bool, shape (N,)
        On the extreme.
    unit : float
        What positions differ by at least.
    """
    long = 20  # samples on an extreme from which on it may be a pause
    stays = [run for run in zip(*runs(there), strict=True) if run[1] - run[0] >= long]
    changes = np.abs(np.diff(force, prepend=force[0]))
    usual = float(np.median(changes[~there])) if not there.all() else 0.0
    rests = []
    for first, stop in stays:
        half = (stop - first) // 2
        ends = position[max(first - half, 0) : first][::-1], position[stop : stop + half]
        away = (np.abs(end - position[first]) / unit for end in ends)
        quiet = np.median(changes[first:stop]) <= _QUIET * usual
        rests.append(bool(quiet) and any(_from_rest(distance) for distance in away))
    resting = np.zeros(len(position), dtype=bool)
    if np.mean(rests or [False]) > _MOST_RESTS:
        for first, stop in stays:
            resting[first:stop] = True
    return resting


def _from_rest(away: Floats) -> bool:
    """Whether a motion begins slowly, by its distance in counts after each sample."""
    clear_counts, fewest_counts = 20, 4
    clear = np.flatnonzero(away >= clear_counts)
    whole = max(int(clear[0]) + 1, 4) if len(clear) else len(away)
    if not 4 <= whole <= len(away) or away[whole - 1] < fewest_counts:
        return True  # it hardly moves, or there is nothing before the first sample
    return bool(away[whole // 2 - 1] < _FROM_REST * away[whole - 1])
