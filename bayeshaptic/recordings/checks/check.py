"""Whether a recording can be used, and what a reader of its report should know about it."""

from __future__ import annotations

import numpy as np

from bayeshaptic.devices.device import Device, kind_of
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.checks.against_device import against_response, compare_resolution
from bayeshaptic.recordings.checks.loop_period import without_doubt
from bayeshaptic.recordings.checks.sufficiency import FEWEST_SAMPLES, says_nothing_of_the_actuator
from bayeshaptic.recordings.checks.two_clocks import two_clocks
from bayeshaptic.recordings.checks.units_in_doubt import degrees, normalised, whole_numbers
from bayeshaptic.recordings.checks.what_drives_what import what_drives_what
from bayeshaptic.recordings.checks.written_digits import written_digits
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.rough_response import RoughResponse, rough_response
from bayeshaptic.recordings.signals.rows.timing import NOTABLE_JITTER, unusual_period
from bayeshaptic.recordings.units import refuse_mixed_units
from bayeshaptic.types import Bools

USUAL_SECONDS = 30
# Of a table: the relative standard deviation from which a row tells no size, and the steps.
MOST_UNSURE, EVEN_LINES = 0.5, 400


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
        "two clocks", "coherence", "two levels", "alignment", and "feedback" where the force was
        computed from the motion.

    Raises
    ------
    InputError
        For a recording that is too short, holds NaN or infinity, whose force or position is
        constant, whose columns are swapped, whose units are of two kinds of motion, or that is not
        of the device's kind.
    """
    where = str(recording.source or recording.name)
    _refuse_unusable(recording, where)
    refuse_mixed_units(recording.force_unit, recording.position_unit, where)
    _refuse_other_kind(recording.position_unit, device, where)
    scales: tuple[Notice, ...] = (
        *_unusual(recording.period_s),
        *_period(recording.period_s, device),
        *_jitter(recording),
        *whole_numbers(recording),
        *degrees(recording),
        *normalised(recording),
        *written_digits(recording),
        *compare_resolution(recording, device),
    )
    rough = rough_response(recording)
    driven = what_drives_what(recording, rough, where)
    # A controller biases the response: there a fit that holds in the loop is asked instead.
    if recording.feedback is None and not has_feedback(driven):
        scales = against_response(scales, recording, device, rough)
    return (
        *without_doubt(recording.notices, recording.period_s, device),
        *scales,
        *two_clocks(recording),
        *says_nothing_of_the_actuator(recording),
        *driven,
    )


def check_table(table: Etfe, device: Device | None = None) -> tuple[Notice, ...]:
    """What a reader of the report should know of a table of a frequency response.

    Parameters
    ----------
    table : Etfe
        Without a recording.
    device : Device or None
        What is known of the device, to compare units with.

    Returns
    -------
    tuple of Notice
        Of the topic "units".

    Raises
    ------
    InputError
        For a table that is not of the device's kind.
    """
    _refuse_other_kind(table.position_unit, device, "the table")
    told = tuple(_unusual(table.period_s))
    clear = table.relative_sd < MOST_UNSURE
    if not clear.any():
        return told
    return against_response(told, table, device, _evenly(table, clear))


def _evenly(table: Etfe, clear: Bools) -> RoughResponse:
    """The size of a table's response where it is clear, at even steps as those of a recording."""
    frequency = table.frequency_hz[clear]
    even = np.linspace(frequency[0], frequency[-1], EVEN_LINES)
    size = np.exp(np.interp(even, frequency, np.log(np.abs(table.value[clear]))))
    return RoughResponse(even, size.astype(complex), np.ones_like(even))


def _refuse_other_kind(position_unit: str, device: Device | None, where: str) -> None:
    kind = kind_of(position_unit)
    if device is not None and device.kind != kind:
        raise InputError(
            f"{where}: a {kind} recording (position in {position_unit}), but "
            f"the device {device.name} is {device.kind}; give the position's unit with "
            f"--columns, as in position=NAME[{device.position_unit}]",
            topic="columns",
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


def _unusual(period: float) -> list[Notice]:
    unusual = unusual_period(period)
    if unusual is None:
        return []
    return [Notice("warning", "units", f"{unusual[0].upper()}{unusual[1:]}.", ("time",))]


def _jitter(recording: Recording) -> list[Notice]:
    if recording.time_jitter is None or recording.time_jitter <= NOTABLE_JITTER:
        return []
    text = (
        f"The time steps vary by {100 * recording.time_jitter:.2g} % of the period (standard "
        "deviation): either the stamps are late, or the samples are; then the noise rises "
        "with the speed."
    )
    return [Notice("warning", "time stamps", text)]


def _period(period: float, device: Device | None) -> list[Notice]:
    if device is None or not device.period_s or abs(period / device.period_s - 1) <= 0.01:
        return []
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
    return [Notice("warning", "period", text)]
