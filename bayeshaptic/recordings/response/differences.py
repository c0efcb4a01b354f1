r"""Whether a recorded velocity is a sensor's own, or made of differences of positions.

A difference of positions over a period is their mean velocity, half a period old, and its sum is
the position again, exactly. What tells the two apart is the colour of the noise: that of a sensor
of velocity is the same at all frequencies, and that of differences rises like :math:`4 \sin^2(\pi f
T)`. Differences that were filtered lie between, and their filter is in the response, where nobody
can tell it from the device's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.random_excitation import estimate_random
from bayeshaptic.types import Floats

# Angles w T between which the noise is compared.
_SLOW, _MIDDLE, _FAST = (0.05, 0.1), (0.2, 0.6), (1.3, 2.0)
# Noise at the fast over that at the middle angles: 0.5 to 1.7 in 16 recordings of tachometers, 8 to
# 21 in as many of an encoder's differences (both devices, free and held, beside a command and a
# measured force), 1.3 to 5.7 where these went through a low-pass of 30 to 200 Hz.
_SENSOR, _DIFFERENCES = 2.0, 7.0
# At the slow over that at the middle angles, where a filter has levelled what is above: 0.6 or more
# of tachometers, 0.12 or less of filtered differences of a free device; a hand hides it.
_LEVELLED = 0.4


def with_differences(recording: Recording) -> Recording:
    """The recording; of differences of positions, with the positions that these were made of.

    Raises
    ------
    InputError
        Where the noise is neither that of a sensor of velocity nor that of differences.
    """
    sensed = recording.sensed
    if sensed is None or sensed.derivatives != 1:
        return recording
    slow, middle, fast = _noise(max(recording.pieces, key=lambda piece: piece.samples))
    if fast > _DIFFERENCES * middle:
        position = np.cumsum(sensed.output) * recording.period_s
        held = replace(sensed, derivatives=0) if sensed.measured_force else None
        text = (
            "The velocity is one of differences of positions (its noise rises with the frequency "
            "as theirs does): summed up, it is the position."
        )
        notices = (*recording.notices, Notice("note", "columns", text))
        return replace(recording, position=position, sensed=held, notices=notices)
    if fast < _SENSOR * middle and slow > _LEVELLED * middle:
        return recording
    raise InputError(
        f"{recording.source or recording.name}: the noise of the velocity is neither that of a "
        "sensor nor that of differences of positions: they were filtered, and the filter cannot "
        "be told from the device; record the position itself"
    )


def _noise(recording: Recording) -> tuple[float, float, float]:
    """Power of the velocity's noise at slow, middle and fast angles."""
    assert recording.sensed is not None
    whole = (1 / recording.duration_s, 0.49 / recording.period_s)
    windows = estimate_random(recording, whole, None)[0].windows()
    theta = 2 * np.pi * recording.period_s * windows.frequency_hz[:, 1]
    power = windows.scatter / (windows.lines - 3) * recording.sensed.noise(theta)
    slow, middle, fast = (_between(theta, power, *part) for part in (_SLOW, _MIDDLE, _FAST))
    return slow, middle, fast


def _between(theta: Floats, power: Floats, low: float, high: float) -> float:
    return float(np.median(power[(theta > low) & (theta < high)]))
