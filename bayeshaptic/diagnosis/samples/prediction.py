"""Each sample from those before it: what does not fit, and what must have been there instead.

A position answers to the force linearly and is disturbed by noise that is nearly Gaussian, so that
a regression of each sample on the past of both, without any mechanical model, predicts it to within
a fraction of an encoder count.  It serves to look at the samples one by one, and to fill in those
that are wrong: nothing here depends on the device's model being right.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.filling import Predictor, fit_predictor
from bayeshaptic.recordings.signals.lone import lone
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Bools, Floats


@dataclass(frozen=True)
class Samples:
    """A recording, and which samples of its position are known to be wrong.

    Attributes
    ----------
    recording : Recording
        As recorded, wrong samples and all.
    missing : ndarray of bool, shape (N,)
        The wrong ones.
    """

    recording: Recording
    missing: Bools

    @cached_property
    def predictor(self) -> Predictor | None:
        """Fitted to the samples that are right."""
        return fit_predictor(self.recording.position, self.recording.force, self.missing)

    @cached_property
    def position(self) -> Floats:
        """The position, its wrong samples filled in."""
        if self.predictor is None:
            return self.recording.position
        return self.predictor.fill(self.recording.position, self.recording.force, self.missing)

    @cached_property
    def errors(self) -> Floats:
        """Of the prediction of every sample."""
        if self.predictor is None:
            return np.zeros(self.recording.samples)
        return self.predictor.errors(self.position, self.recording.force)

    @cached_property
    def unit(self) -> float:
        """What the recorded positions are multiples of, zero where they are of nothing."""
        return increment_unit(self.recording.position[~self.missing]) or 0.0

    @cached_property
    def range_of_force(self) -> tuple[float, float]:
        """Between its lowest and highest value."""
        return float(self.recording.force.min()), float(self.recording.force.max())

    def without(self, wrong: Bools) -> Samples:
        """The same with more samples known to be wrong; itself where there are no more."""
        missing = self.missing | wrong
        # A predictor is a regression of a tenth of a second.
        return self if np.array_equal(missing, self.missing) else replace(self, missing=missing)

    @property
    def mended(self) -> Recording:
        """The recording with its wrong samples filled in."""
        if not self.missing.any():
            return self.recording
        return replace(self.recording, position=self.position)


def as_recorded(recording: Recording) -> Samples:
    """All samples taken to be right but those far from any beside them.

    A few that are off by more than the device moves would decide every coefficient.
    """
    return Samples(recording, lone(recording.position))
