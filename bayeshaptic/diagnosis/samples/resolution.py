"""Positions in coarser counts than was declared, or than the motion can bear."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.prediction import Samples
from bayeshaptic.recordings.response.etfe import Etfe

_POOR = 0.075  # median relative standard deviation of the response


@dataclass(frozen=True)
class Resolution:
    """Found and declared counts.

    Attributes
    ----------
    count : float
        What the positions are multiples of; zero where they are of nothing.
    declared : float or None
    statistic : float
        Found over declared; without a declared one, by how much the counts are too coarse for the
        motion, on the same scale.
    """

    count: float
    declared: float | None
    statistic: float


def resolution(samples: Samples, etfe: Etfe) -> Resolution:
    """The count that the positions show, against the declared one.

    Without a declared count a coarse one is nobody's fault, and is found only where it spoils the
    measurement: few counts a second, a response that is hardly known, and no other noise.
    """
    unit, declared = samples.unit, samples.recording.encoder_resolution
    if unit == 0:
        return Resolution(0.0, declared, 0.0)
    if declared:
        return Resolution(unit, declared, unit / declared)
    recording = samples.recording
    speed = float(np.mean(np.abs(np.diff(recording.position)))) / (unit * recording.period_s)
    poor = float(np.median(etfe.relative_sd)) / _POOR
    its_own = 3.0  # squared prediction error over what rounding leaves
    rounding = samples.predictor is not None and (
        samples.predictor.spread**2 < its_own * unit**2 / 6
    )
    slow = 350.0  # counts a second, in the mean: usual encoders give twice that and more
    coarse = min(slow / speed, poor) if rounding else 0.0
    return Resolution(unit, None, thresholds.RESOLUTION * coarse)
