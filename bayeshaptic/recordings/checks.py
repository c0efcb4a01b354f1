"""Whether a recording can be used, and what a reader of its report should know about it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.devices import STRUCTURES, Device
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.causality import causality
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.recordings.signals.timing import NOTABLE_JITTER
from bayeshaptic.recordings.sufficiency import (
    FEWEST_SAMPLES,
    LEAST_COHERENCE,
    says_nothing_of_the_actuator,
)
from bayeshaptic.recordings.units_in_doubt import (
    degrees,
    implausible_mass,
    mixed_units,
    whole_numbers,
)

USUAL_SECONDS = 30
# Slips of units: thousands, and degrees for radians; with the cure for each.
_SLIPS = {
    1e3: "is it in thousandths of the unit, such as mm? Write [mm] or *1e-3",
    1e-3: "is it scaled by 1e-3 twice, or in another unit?",
    1e6: "is it in millionths of the unit, such as um? Write [um] or *1e-6",
    1e-6: "is it scaled by 1e-6 twice, or in another unit?",
    180 / np.pi: "is it in degrees? Write [deg]",
    np.pi / 180: "is it radians, scaled as degrees?",
}


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
    scales = (
        *_period(recording, device),
        *mixed_units(recording),
        *whole_numbers(recording),
        *degrees(recording),
        *_resolution(recording, device),
    )
    # A slip of units need not be found twice.
    slipped = any((n.level, n.topic) == ("warning", "units") for n in scales)
    return (
        *recording.notices,
        *scales,
        *_response(recording, device, slipped),
        *says_nothing_of_the_actuator(recording),
        *_causality(recording, where),
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
        notices.append(Notice("warning", "units", text))
    if recording.time_jitter is not None and recording.time_jitter > NOTABLE_JITTER:
        text = (
            f"The time steps vary by {100 * recording.time_jitter:.2g} % of the period (standard "
            "deviation): either the stamps are late, or the samples are; then the noise rises "
            "with the speed."
        )
        notices.append(Notice("warning", "time stamps", text))
    if device is not None and device.period_s and abs(period / device.period_s - 1) > 0.01:
        text = (
            f"The recording's period is {period:g} s, the device's {device.period_s:g} s; K_CR "
            "is that of a loop with the recording's period."
        )
        notices.append(Notice("warning", "period", text))
    return notices


def _resolution(recording: Recording, device: Device | None) -> list[Notice]:
    """Compare the steps in which the position moves with the encoder's count."""
    unit = recording.position_unit
    step = increment_unit(recording.position)
    notices = []
    if step is not None and np.ptp(recording.position) < 20 * step:
        text = (
            f"The position moves over {np.ptp(recording.position) / step:.0f} counts of {step:.3g} "
            f"{unit} only; excite the device more, or little can be learnt."
        )
        notices.append(Notice("warning", "resolution", text))
    known = recording.encoder_resolution
    if known is None and device is not None:
        known = device.encoder_resolution
    if step is None or known is None or abs(step / known - 1) < 0.05:
        return notices
    slip = _slip(step / known, 1.05)
    if slip is not None:
        text = (
            f"The position moves in steps of {step:.3g} {unit}, {slip:.3g} times the encoder's "
            f"resolution of {known:.3g} {unit}: {_SLIPS[slip]} in --columns."
        )
        notices.append(Notice("warning", "units", text))
    elif step > known:
        text = (
            f"The position moves in steps of {step:.3g} {unit}, the encoder's resolution is said "
            f"to be {known:.3g} {unit}."
        )
        notices.append(Notice("note", "resolution", text))
    return notices


def _slip(ratio: float, tolerance: float) -> float | None:
    """The slip of units that a ratio shows, within a factor; None where it shows none."""
    nearest = min(_SLIPS, key=lambda slip: abs(np.log(ratio / slip)))
    return nearest if 1 / tolerance < ratio / nearest < tolerance else None


def _response(recording: Recording, device: Device | None, slipped: bool) -> list[Notice]:
    """Compare a rough frequency response with none at all, and with the device's own."""
    rough = rough_response(recording)
    if rough.follows < LEAST_COHERENCE:
        text = (
            f"The position hardly answers to the force: their coherence is below "
            f"{rough.follows:.2f} on nine lines in ten. Are these the right columns?"
        )
        return [Notice("warning", "coherence", text)]
    clear = rough.clear()
    if recording.force_unit == "A" or len(clear.response) < 5:
        return []
    if device is None:
        return [] if slipped else implausible_mass(recording, clear)
    s = 2j * np.pi * clear.frequency_hz
    ratios = [
        float(np.median(np.abs(clear.response / compliance)))
        for compliance in _compliances(device, s)
    ]
    # Nobody knows here whether the device was held: the nearest of its models counts.
    ratio = min(ratios, key=lambda ratio: abs(np.log(ratio)), default=1.0)
    if 0.05 < ratio < 20:
        return []
    slip = _slip(ratio, 4)
    text = (
        f"The position answers {ratio:.2g} times as much to the force as that of {device.name} "
        f"should: a slip of units? Perhaps the position is {slip or ratio:.3g} times too large, or "
        f"the force {1 / (slip or ratio):.3g} times. Give the units with --columns, as in "
        "position=NAME[mm]."
    )
    return [Notice("warning", "units", text)]


def _compliances(device: Device, s: NDArray[Any]) -> list[NDArray[Any]]:
    """Position over force at the motor of each model that the device file gives in full.

    The rigid one counts only where it is alone: it is far off above the first mode.
    """
    full = {
        structure: device.parameters[structure]
        for structure, names in STRUCTURES.items()
        if set(names) <= set(device.parameters.get(structure, {}))
    }
    if set(full) == {"rigid"}:
        return [1 / (full["rigid"]["m"] * s**2 + full["rigid"]["b"] * s)]
    found = []
    for structure, p in full.items():
        if structure == "rigid":
            continue
        load = p["m2"] * s**2 + p["b2"] * s
        if structure == "grasped":
            hand = p["mh"] * s**2 + p["bh"] * s + p["kh"]
            load = load + 1 / (1 / (p["bs"] * s + p["ks"]) + 1 / hand)
        load = 1 / (1 / (p["bc"] * s + p["kc"]) + 1 / load)
        found.append(1 / (p["m1"] * s**2 + p["b1"] * s + load))
    return found


def _causality(recording: Recording, where: str) -> list[Notice]:
    """What drives what; of a measured force, whose past its motion knows better, the sign alone."""
    found = causality(recording)
    measured = recording.sensed is not None and recording.sensed.measured_force
    if measured and not rough_response(recording).opposite(recording.period_s):
        return []
    if found.swapped and not measured:
        raise InputError(
            f"{where}: force and position look swapped: the past position predicts the force (it "
            f"removes {100 * found.removed:.0f} % of the error), the past force does not "
            "predict the position; exchange them with --columns force=...,position=...",
            topic="swapped",
        )
    against = not found.relay and rough_response(recording).opposite(recording.period_s)
    if measured or found.opposite or (against and not found.has_feedback):
        raise InputError(
            f"{where}: the position moves against the force: one of them has the opposite sign, "
            "and the device would have a negative mass; turn one round with --columns, as in "
            "position=NAME*-1",
            topic="swapped",
        )
    if found.relay:
        raise InputError(
            f"{where}: a relay recording (the force switches between {recording.force.min():.3g} "
            f"and {recording.force.max():.3g} {recording.force_unit} where the position passes a "
            "set point), of which no frequency response can be estimated; its gain margin is read "
            f"by: bayeshaptic relay {where}",
            topic="relay",
        )
    if found.has_feedback:
        text = (
            f"The force was computed from the motion ({found.evidence}): the recording was made in "
            "closed loop, so the ETFE, the fit and K_CR are biased. Excite the device with a force "
            "that does not depend on the motion."
        )
        if against:
            text += (
                " The position goes against the force: if this was an open loop, one of them has "
                "the opposite sign; turn it round with --columns, as in position=NAME*-1."
            )
        return [Notice("warning", "feedback", text)]
    if found.doubtful:
        text = (
            f"It cannot be decided whether the force was computed from the motion "
            f"({found.evidence}, more than chance but little). If the recording was made in closed "
            "loop, the ETFE, the fit and K_CR are biased: record again with a force that does not "
            "depend on the motion, and longer."
        )
        return [Notice("warning", "feedback", text)]
    own = recording.sensed is None or recording.sensed.derivatives == 0
    if own and rough_response(recording).is_velocity(recording.period_s):
        raise InputError(
            f"{where}: what should be the position looks like a velocity: a mass with a damper "
            "explains it as its velocity, and not as its position; say so with --columns, as in "
            "velocity=NAME[rad/s], or give the position",
            topic="swapped",
        )
    if found.early_position:
        text = (
            "The position answers to the force within the same sample: it seems to be recorded "
            "one sample early, and the delay will come out up to one period too short. Pair "
            "each force with the position that was read before it was commanded."
        )
        return [Notice("warning", "alignment", text)]
    return []
