"""Slips of units: steps and response of a recording beside what is known of its device."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.devices import STRUCTURES, Device
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.checks.sufficiency import LEAST_COHERENCE
from bayeshaptic.recordings.checks.units_in_doubt import (
    implausible_mass,
    not_of_the_position,
    other_units,
)
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rough_response import RoughResponse

# Slips of units: thousands, and degrees for radians; with the cure for each.
_SLIPS = {
    1e3: "is it in thousandths of the unit, such as mm? Write [mm] or *1e-3",
    1e-3: "is it scaled by 1e-3 twice, or in another unit? Say it",
    1e6: "is it in millionths of the unit, such as um? Write [um] or *1e-6",
    1e-6: "is it scaled by 1e-6 twice, or in another unit? Say it",
    180 / np.pi: "is it in degrees? Write [deg]",
    np.pi / 180: "is it radians, scaled as degrees? Write [rad]",
}
# A position that was filtered has finer steps than counts, and files round it: by more only where
# the unit of one of the two is wrong.
_FINER = 30.0
_MOST = 20.0  # times as much as the device file says, or as little: another such device may answer
_SURELY = 30.0  # beyond it no stiffness follows: no two devices that share a file differ so


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
    if known is not None and step != known:
        _refuse_coarse(recording, step or 0.0, known)
    if step is None or known is None or abs(step / known - 1) < 0.05:
        return notices
    slip = _slip(step / known, 1.05)
    if slip is not None:
        text = (
            f"The position moves in steps of {step:.3g} {unit}, {slip:.3g} times the encoder's "
            f"resolution of {known:.3g} {unit}: {_SLIPS[slip]} in --columns."
        )
        notices.append(Notice("warning", "units", text, ("position",)))
    elif step > known:
        text = (
            f"The position moves in steps of {step:.3g} {unit}, the encoder's resolution is said "
            f"to be {known:.3g} {unit}."
        )
        notices.append(Notice("note", "resolution", text))
    elif step < known / _FINER:
        text = (
            f"The position moves in steps of {step:.3g} {unit}, and one count of the encoder is "
            f"said to be {known:.3g} {unit}: correct --encoder-resolution, which is in {unit}, or "
            "the device's file."
        )
        notices.append(Notice("warning", "units", text, ("position",)))
    return notices


def _refuse_coarse(recording: Recording, step: float, known: float) -> None:
    """Refuse a count that is larger than the motion, which has steps within it."""
    moved = float(np.ptp(recording.position))
    if moved < 2 * known and step < known / 2:
        unit = recording.position_unit
        raise InputError(
            f"{recording.source or recording.name}: one count of the encoder is said to be "
            f"{known:.3g} {unit}, and the whole motion is {moved:.3g} {unit}; correct "
            f"--encoder-resolution, which is in {unit}, or the device's file",
            topic="units",
        )


def _slip(ratio: float, tolerance: float) -> float | None:
    """The slip of units that a ratio shows, within a factor; None where it shows none."""
    nearest = min(_SLIPS, key=lambda slip: abs(np.log(ratio / slip)))
    return nearest if 1 / tolerance < ratio / nearest < tolerance else None


def response_ratio(
    recording: Recording | Etfe, device: Device | None, rough: RoughResponse
) -> float | None:
    """How many times as much the position answers as that of the device file's nearest model.

    None where nothing can be compared: no force constant, no mass in the file, no clear answer.
    """
    clear = rough.clear()
    if recording.force_unit == "A" or len(clear.response) < 5 or not says_the_mass(device):
        return None
    assert device is not None
    s = 2j * np.pi * clear.frequency_hz
    ratios = np.array([np.abs(clear.response / each) for each in _compliances(device, s)])
    if set(_in_full(device)) == {"rigid"}:  # true below the first vibration mode alone
        lowest = np.argsort(clear.frequency_hz)[: max(5, len(s) // 20)]
        ratios = ratios[:, lowest]
    # Nobody knows here whether the device was held: the nearest of its models counts.
    return float(min(np.median(ratios, axis=1), key=lambda ratio: abs(np.log(ratio))))


def against_response(
    notices: Iterable[Notice],
    recording: Recording | Etfe,
    device: Device | None,
    rough: RoughResponse,
) -> tuple[Notice, ...]:
    """What was said of units, with what a response says of them.

    Parameters
    ----------
    notices : iterable of Notice
        That the response of the device may confirm to be harmless.
    recording : Recording, or Etfe of a table
    device : Device or None
    rough : RoughResponse
        That holds: in closed loop a fitted model's, since the measured one is biased.
    """
    told = tuple(notices)
    if confirms(response_ratio(recording, device, rough)):
        told = not_of_the_position(told)
    # A slip of units need not be found twice.
    slipped = any((n.level, n.topic) == ("warning", "units") for n in told)
    return (*told, *compare_response(recording, device, rough, slipped))


def confirms(ratio: float | None) -> bool:
    """Whether a device answers about as much as its file says: no unit is in doubt then."""
    return ratio is not None and 1 / _MOST < ratio < _MOST


def compare_response(
    recording: Recording | Etfe, device: Device | None, rough: RoughResponse, slipped: bool
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
    ratio = response_ratio(recording, device, rough)
    if ratio is None or device is None:
        return [] if slipped else implausible_mass(recording, clear)
    if confirms(ratio):
        return []
    slip = _slip(ratio, 4) or ratio
    cure = other_units(slip, recording.force_unit, device.position_unit)
    text = (
        f"The position answers {ratio:.2g} times as much to the force as that of {device.name} "
        f"should: a slip of units? With {cure} it would be "
        "as the device's file says; correct the units in --columns, or the file."
    )
    far = not 1 / _SURELY < ratio < _SURELY
    return [Notice("warning", "units", text, ("position",) if far else ())]


def says_the_mass(device: Device | None) -> bool:
    """Whether a device file says enough to compare a response with: a mass, or all of a model."""
    return device is not None and bool(_in_full(device))


def _in_full(device: Device) -> dict[str, dict[str, float]]:
    """The models that a device file gives in full; one mass may be without its damper."""
    return {
        structure: {"b": 0.0, **parameters} if structure == "rigid" else dict(parameters)
        for structure, parameters in device.parameters.items()
        if set(STRUCTURES[structure]) - {"b"} <= set(parameters)
    }


def _compliances(device: Device, s: NDArray[Any]) -> list[NDArray[Any]]:
    """Position over force at the motor of each model that the device file gives in full.

    The rigid one counts only where it is alone: it is far off above the first mode.
    """
    full = _in_full(device)
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
