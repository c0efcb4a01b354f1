r"""Whether a recorded velocity is a sensor's own, or made of differences of positions.

A difference of positions over a period is their mean velocity, half a period old, and its sum is
the position again, exactly. What tells the two apart is the colour of the noise: that of a sensor
of velocity is the same at all frequencies, and that of differences rises like :math:`4 \sin^2(\pi f
T)`. Differences that were filtered lie between, and their filter is in the response, where nobody
can tell it from the device's.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimators.random_excitation import windows_of_all

# Angles w T between which the noise is compared.
_SLOW, _LOWER, _MIDDLE, _FAST = (0.05, 0.1), (0.2, 0.6), (0.3, 0.6), (1.3, 2.0)
# Noise at the fast over that at the middle angles.  Beside a command, 24 recordings each (both
# devices, free and held): tachometers 0.6 to 1.07, an encoder's differences 10.0 to 13.5, these
# through a low-pass of 30 to 200 Hz 1.2 to 6.0.  Beside a measured force tachometers reach 1.5 and
# differences begin at 7.1.
_SENSOR, _SENSOR_OF_BOTH, _DIFFERENCES = 1.13, 2.0, 6.5
_SDS = 3.5  # of a short recording's noise
# At the slow over that at the lower angles, where a filter has levelled what is above: 0.6 or more
# of tachometers, 0.16 or less of filtered differences of a free device; a hand hides it.
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
    noise = _noise(max(recording.pieces, key=lambda piece: piece.samples))
    slow, lower, middle, fast = noise.power
    if fast > _DIFFERENCES * middle:
        position = np.cumsum(sensed.output) * recording.period_s
        held = replace(sensed, derivatives=0) if sensed.measured_force else None
        text = (
            "The velocity is one of differences of positions (its noise rises with the frequency "
            "as theirs does): summed up, it is the position."
        )
        notices = (*recording.notices, Notice("note", "columns", text))
        return replace(recording, position=position, sensed=held, notices=notices)
    white = _SENSOR_OF_BOTH if sensed.measured_force else max(_SENSOR, 1 + _SDS * noise.sd)
    if fast < white * middle and slow > _LEVELLED * lower:
        return recording
    raise InputError(
        f"{recording.source or recording.name}: the noise of the velocity is neither that of a "
        "sensor nor that of differences of positions: they were filtered, and the filter cannot "
        "be told from the device; record the position itself"
    )


class _Noise(NamedTuple):
    """Power of the velocity's noise at slow, lower, middle and fast angles.

    `sd` is that of the fast one over the middle one, relative.
    """

    power: tuple[float, ...]
    sd: float


def _noise(recording: Recording) -> _Noise:
    assert recording.sensed is not None
    windows = windows_of_all(recording)
    theta = 2 * np.pi * recording.period_s * windows.frequency_hz[:, 1]
    freedom = windows.lines - 3
    power = windows.scatter / freedom * recording.sensed.noise(theta)
    parts = [(theta > low) & (theta < high) for low, high in (_SLOW, _LOWER, _MIDDLE, _FAST)]
    of_median = np.pi / 2  # variance of a median over that of the mean
    sd = np.sqrt(of_median * sum(1 / freedom[part].sum() for part in parts[2:]))
    return _Noise(tuple(float(np.median(power[part])) for part in parts), float(sd))
