"""The slow part of what pushed a device from outside, which only the motion long after tells.

A regression on some fifty samples (`outside`) knows what pushed from sample to sample, and hardly
the impulse that it had in all: that is a speed which the device keeps.  A model follows it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.legendre import legval

from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows, remembered
from bayeshaptic.recordings.signals.filling import ORDER
from bayeshaptic.types import Floats

_WEIGHED = 5  # rounds for the noise of each window, which is what is left in it


def slow_push(fit: Fit, etfe: Etfe, recording: Recording, moments: Sequence[slice]) -> Floats:
    """Force within moments that a fit of their recording still leaves, shape (N,).

    Polynomials over each moment, about one a memory of the regression, by least squares on what no
    smooth response explains in any window.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    recording : Recording
        That `etfe` was estimated from, in one piece.
    moments : sequence of slice
    """
    at_lines = Lines.of(etfe, recording)
    pushes = np.concatenate([_polynomials(moment, recording.samples) for moment in moments])
    response = fit.response(at_lines.frequency_hz)
    moved = np.stack([response * at_lines(push) for push in pushes])
    windows = etfe.spectra.windows(remembered(fit.response), moved)
    return np.asarray(_common_coefficients(windows, len(pushes)) @ pushes)


def _polynomials(moment: slice, samples: int) -> Floats:
    """Legendre's, zero outside the moment, shape (J, N)."""
    length = moment.stop - moment.start
    count = 2 + length // ORDER  # of the shortest moment, what a mass keeps: place and speed
    found = np.zeros((count, samples))
    found[:, moment] = legval(np.linspace(-1, 1, length), np.eye(count))
    return found


def _common_coefficients(windows: Windows, inputs: int) -> Floats:
    """Coefficients of the last inputs, the same in all windows whose response is free, (J,)."""
    design, target = windows.design[:, -inputs:, -inputs:], windows.target[:, -inputs:]
    freedom = np.maximum(windows.lines - windows.frequency_hz.shape[1], 0.5)
    found = np.zeros(inputs)
    for _ in range(_WEIGHED):
        left = target - design @ found
        weight = freedom / (windows.scatter + np.sum(np.abs(left) ** 2, axis=1))
        rows = np.sqrt(weight)[:, None, None] * design
        aims = np.sqrt(weight)[:, None] * target
        real = np.concatenate([rows.real, rows.imag]).reshape(-1, inputs)
        found = np.linalg.lstsq(real, np.concatenate([aims.real, aims.imag]).ravel())[0]
    return np.asarray(found)
