"""Whether a recording can be used, and what a reader of its report should know about it."""

from __future__ import annotations

import numpy as np

from bayeshaptic.devices import Device
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.checks.against_device import (
    against_response,
    compare_resolution,
)
from bayeshaptic.recordings.checks.sufficiency import FEWEST_SAMPLES, says_nothing_of_the_actuator
from bayeshaptic.recordings.checks.units_in_doubt import (
    degrees,
    mixed_units,
    whole_numbers,
)
from bayeshaptic.recordings.checks.what_drives_what import what_drives_what
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.recordings.signals.timing import NOTABLE_JITTER

USUAL_SECONDS = 30


def check_recording(recording: Recording, device: Device | None = None) -> tuple[Notice, ...]:
    """Refuse what cannot be used; say what should be known.

    Parameters
    ----------
    recording : Recording
    device : Device or None
        What is known of the device, to compare units, resolution and period with.

    Returns
    -------
    tuple of Notice
        Those of the recording itself, then by topic: "units", "time stamps", "resolution",
        "coherence", "two levels", "alignment", and "feedback" where the force was computed from
        the motion.

    Raises
    ------
    InputError
        For a recording that is too short, holds NaN or infinity, whose force or position is
        constant, whose columns are swapped, or that is not of the device's kind.
    """
    where = str(recording.source or recording.name)
    _refuse_unusable(recording, where)
    if device is not None and device.kind != recording.kind:
        raise InputError(
            f"{where}: a {recording.kind} recording (position in {recording.position_unit}), but "
            f"the device {device.name} is {device.kind}; give the position's unit with "
            f"--columns, as in position=NAME[{device.position_unit}]",
            topic="columns",
        )
    scales: tuple[Notice, ...] = (
        *_period(recording, device),
        *mixed_units(recording),
        *whole_numbers(recording),
        *degrees(recording),
        *compare_resolution(recording, device),
    )
    rough = rough_response(recording)
    driven = what_drives_what(recording, rough, where)
    # A controller biases the response: there a fit that holds in the loop is asked instead.
    if recording.feedback is None and not has_feedback(driven):
        scales = against_response(scales, recording, device, rough)
    return (
        *recording.notices,
        *scales,
        *says_nothing_of_the_actuator(recording),
        *driven,
    )


def _refuse_unusable(recording: Recording, where: str) -> None:
    samples = recording.samples
    if len(recording.position) != samples:
        raise InputError(
            f"{where}: {samples} samples of force and {len(recording.position)} of position",
            topic="rows",
        )
    if samples < FEWEST_SAMPLES:
        raise InputError(
            f"{where}: {samples} samples ({recording.duration_s:.3g} s) are too few: at least "
            f"{FEWEST_SAMPLES} ({FEWEST_SAMPLES * recording.period_s:.3g} s at this period) are "
            f"needed, and {USUAL_SECONDS} s are usual",
            topic="too-little",
        )
    for what, signal in (("force", recording.force), ("position", recording.position)):
        bad = np.flatnonzero(~np.isfinite(signal))
        if len(bad):
            raise InputError(
                f"{where}: the {what} is {signal[bad[0]]} in row {bad[0] + 1} ({len(bad)} such "
                "rows)",
                topic="rows",
            )
    if np.ptp(recording.force) == 0:
        raise InputError(
            f"{where}: the force is constant ({recording.force[0]:g} {recording.force_unit}); "
            "nothing can be learnt without an excitation: is it the right column?"
        )
    if np.ptp(recording.position) == 0:
        raise InputError(
            f"{where}: the position never changes ({recording.position[0]:g} "
            f"{recording.position_unit}): is the encoder connected, and is it the right column?"
        )


def _period(recording: Recording, device: Device | None) -> list[Notice]:
    notices = []
    period = recording.period_s
    if not 2e-6 < period < 0.1:
        text = (
            f"The sampling period is {period:g} s, which no haptic loop has: is the time in ms "
            "or us? Write time=NAME[ms] or time=NAME[us] in --columns."
        )
        notices.append(Notice("warning", "units", text, ("time",)))
    if recording.time_jitter is not None and recording.time_jitter > NOTABLE_JITTER:
        text = (
            f"The time steps vary by {100 * recording.time_jitter:.2g} % of the period (standard "
            "deviation): either the stamps are late, or the samples are; then the noise rises "
            "with the speed."
        )
        notices.append(Notice("warning", "time stamps", text))
    if device is None or not device.period_s or abs(period / device.period_s - 1) <= 0.01:
        return notices
    text = (
        f"The recording's period is {period:g} s, the device's {device.period_s:g} s; K_CR is that "
        "of a loop with the recording's period."
    )
    every = round(period / device.period_s)
    if every > 1 and abs(period / device.period_s / every - 1) <= 0.01:
        text += (
            f" If the loop ran with the device's, one sample in {every} was written down: then the "
            "forces between are missing, and nothing of this is true; write every sample down."
        )
    notices.append(Notice("warning", "period", text))
    return notices
