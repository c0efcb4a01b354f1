"""Whether force and position were written down by clocks of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import pure, quantity
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.rough_response import RoughResponse, rough_response

_PARTS = 3
_FEWEST_LINES, _FEWEST_SAMPLES = 12, 3000
_FARTHEST, _STEP = 8.0, 0.025  # samples
# Of 150 simulated recordings without it none is moved by more than 0.15 of a sample.
_LEAST = 0.25  # samples from the first part to the last
_ALIKE, _BETTER = 0.98, 0.02  # the mean cosine of what is left of the phase, and by how much more


class _Moved(NamedTuple):
    """By how many samples one part lags behind another, and how well that says what they differ by.

    Attributes
    ----------
    samples : float
    alike, unmoved : float
        Mean cosine of the phase between the two responses, less the lag's, and as it is.
    """

    samples: float
    alike: float
    unmoved: float


def two_clocks(recording: Recording) -> list[Notice]:
    """That the position comes later and later against the force, or earlier and earlier.

    Two responses of one device, from the first third of a recording and the last, then differ by a
    phase that goes with the frequency, and by nothing else; under a controller, too.  A device that
    changes does otherwise.

    Parameters
    ----------
    recording : Recording
    """
    if recording.joints or recording.samples < _FEWEST_SAMPLES:
        return []
    length = recording.samples // _PARTS
    parts = [_part(recording, slice(k * length, (k + 1) * length)) for k in range(_PARTS)]
    whole, *steps = (
        _moved(parts[a], parts[b], recording.period_s) for a, b in ((0, -1), (0, 1), (1, -1))
    )
    if whole is None or abs(whole.samples) < _LEAST:
        return []
    if whole.alike < max(_ALIKE, whole.unmoved + _BETTER):
        return []
    if any(step is None or step.samples * whole.samples < 0 for step in steps):
        return []
    later = "later" if whole.samples > 0 else "earlier"
    moved = abs(whole.samples) * recording.period_s
    rate = 1e6 * abs(whole.samples) / ((_PARTS - 1) * length)
    text = (
        f"From the first third of the recording to the last the position comes {later} and "
        f"{later} against the force, by {quantity(moved, 's', digits=2)}: as where each was "
        f"written down by a clock of its own, {pure(rate, 2)} millionths apart, or rows were "
        "lost in one of them alone. The delay, and with it the limit, may be that of no loop. "
        "Write both down in one program, or correct the time of one by that rate."
    )
    return [Notice("warning", "two clocks", text)]


def _part(recording: Recording, rows: slice) -> RoughResponse:
    return rough_response(
        replace(
            recording,
            force=recording.force[rows],
            position=recording.position[rows],
            reference=None,
        )
    )


def _moved(one: RoughResponse, other: RoughResponse, period_s: float) -> _Moved | None:
    """None where the two have too few lines in common on which the position follows the force."""
    one, other = one.clear(), other.clear()
    frequency, here, there = np.intersect1d(
        one.frequency_hz, other.frequency_hz, return_indices=True
    )
    if len(frequency) < _FEWEST_LINES:
        return None
    turned = other.response[there] * np.conj(one.response[here])
    turned /= np.abs(turned)
    count = round(_FARTHEST / _STEP)
    lags = _STEP * np.arange(-count, count + 1)
    phase = 2j * np.pi * period_s * np.outer(lags, frequency)
    alike = np.mean(np.exp(phase) * turned, axis=1).real
    best = int(np.argmax(alike))
    return _Moved(float(lags[best]), float(alike[best]), float(alike[count]))
