"""Samples that are read early or late: the noise rises with the speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.prediction import Samples
from bayeshaptic.recordings.signals.rows.timing import NOTABLE_JITTER
from bayeshaptic.types import Floats

_BLOCK = 100  # samples whose errors may be alike
_FILTERS = (np.array([1.0]), np.array([1.0, 1.0]), np.array([1.0, -1.0]))


@dataclass(frozen=True)
class Jitter:
    """How the error of the prediction grows with the speed.

    Attributes
    ----------
    score : float
        Standard deviations; zero where the error is not that of samples off their time.
    threshold : float
        Lower where the time stamps show jitter, too.
    sd_s, sd_sd_s : float
        Standard deviation of the sampling instants, and its own.
    """

    score: float
    threshold: float = thresholds.JITTER
    sd_s: float = 0.0
    sd_sd_s: float = 0.0


def jitter(samples: Samples) -> Jitter:
    """Does the squared error of the prediction grow with the squared speed?

    A sample read at the wrong instant is off by speed times lateness, independently of the next
    one; what passes the predictor must then have its share at low and at high frequencies.  Forces
    that the linear prediction does not know grow with the speed too, but are slow.
    """
    predictor, recording = samples.predictor, samples.recording
    stamped = recording.time_jitter is not None and recording.time_jitter > NOTABLE_JITTER
    threshold = thresholds.JITTER_STAMPED if stamped else thresholds.JITTER
    nothing = Jitter(0.0, threshold)
    if predictor is None or recording.samples < 20 * _BLOCK:
        return nothing
    speed = savgol_filter(samples.position, 9, 3, deriv=1)
    if speed.std() < samples.unit:  # then rounding depends on the speed
        return nothing
    slopes, scores = [], []
    for taps in _FILTERS:
        skip = predictor.order + len(taps) - 1
        power = np.convolve(samples.errors, taps)[skip : recording.samples] ** 2
        expected = np.sum(np.convolve(predictor.past, taps) ** 2) * speed[skip:] ** 2
        there = ~samples.missing[skip:]
        slope, sd = _slope(power[there], expected[there])
        slopes.append(slope)
        scores.append(slope / sd)
    alike = 0.5
    if min(slopes) <= alike * max(slopes):
        return nothing
    lateness = float(np.sqrt(slopes[0])) * recording.period_s
    return Jitter(min(scores), threshold, lateness, 0.5 * lateness / scores[0])


def _slope(power: Floats, expected: Floats) -> tuple[float, float]:
    """Regression of one on the other, with a standard deviation that allows for blocks alike."""
    centred = expected - expected.mean()
    information = float(centred @ centred)
    slope = float(centred @ power) / information
    left = centred * (power - power.mean() - slope * centred)
    whole = left[: len(left) // _BLOCK * _BLOCK].reshape(-1, _BLOCK).sum(axis=1)
    return slope, float(np.sqrt(whole @ whole)) / information
