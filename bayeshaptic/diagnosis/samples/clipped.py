"""Positions that were cut off at the end of the sensor's range."""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.prediction import Bools, Samples

_FEWEST = 4  # samples on an extreme that are worth a look
_LEVELS = 4  # a position that takes fewer is none


def clipped(samples: Samples) -> tuple[Bools, float]:
    """Samples on an extreme that, by all others, must have been beyond it.

    A motion that merely turns round stays on its last level for a while too, but does not lead
    beyond it.

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
    extremes = [(sign, there) for sign, there in extremes if there.sum() >= _FEWEST]
    if not extremes or len(np.unique(position)) <= _LEVELS:
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
        if len(beyond) < _FEWEST:
            continue
        beyond = np.sort(beyond)
        statistic = max(statistic, float(beyond[-_FEWEST // 2]))
        if beyond[-_FEWEST // 2] > thresholds.CLIPPED:
            wrong |= there
    return wrong, statistic
