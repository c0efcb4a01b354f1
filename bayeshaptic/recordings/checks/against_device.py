"""Slips of units: steps and response of a recording beside what is known of its device."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.devices import STRUCTURES, Device
from bayeshaptic.errors import Notice
from bayeshaptic.recordings.checks.sufficiency import LEAST_COHERENCE
from bayeshaptic.recordings.checks.units_in_doubt import implausible_mass
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rough_response import RoughResponse

# Slips of units: thousands, and degrees for radians; with the cure for each.
_SLIPS = {
    1e3: "is it in thousandths of the unit, such as mm? Write [mm] or *1e-3",
    1e-3: "is it scaled by 1e-3 twice, or in another unit?",
    1e6: "is it in millionths of the unit, such as um? Write [um] or *1e-6",
    1e-6: "is it scaled by 1e-6 twice, or in another unit?",
    180 / np.pi: "is it in degrees? Write [deg]",
    np.pi / 180: "is it radians, scaled as degrees?",
}


def compare_resolution(recording: Recording, device: Device | None) -> list[Notice]:
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


def compare_response(
    recording: Recording, device: Device | None, rough: RoughResponse, slipped: bool
) -> list[Notice]:
    """Whether the position answers at all, and as much as the device file says."""
    if rough.follows < LEAST_COHERENCE:
        text = (
            "The position hardly answers to the force: in the octave where it answers best their "
            f"coherence is {rough.follows:.2f}. Are these the right columns?"
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
