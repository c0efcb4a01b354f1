"""Units that a recording itself makes doubtful."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rough_response import RoughResponse
from bayeshaptic.recordings.units import is_assumed
from bayeshaptic.types import Floats

# Mass of a device as its motor feels it: the lightest, a usual and the heaviest one; and from where
# on it is doubted if nobody said the units, since what is a thousand times too heavy gets a limit
# that is a thousand times too high.  A push of a hand, 50 N, moves 140 kg by a third of a m/s^2
# only, and a servo axis of a machine tool, 95 kg, is still below it; an outstretched leg is 2.5
# kg m^2 about the hip.  Motors of 0.15 kg, or of 3e-3 kg m^2, are beyond it in mm or mrad.
_MASSES = {
    ("N", "m"): (3e-3, 0.5, 140.0, 50.0, "kg"),
    ("Nm", "rad"): (1e-7, 1e-3, 3.0, 0.3, "kg m^2"),
}
# A position that was brought to a scale of its own ends there to so much, unless it was written in
# so many decimals; and an extreme that is cut off stands in more rows than that.  Seen in four of
# four such recordings, and in none of 484 others.
_AT_SCALE, _DECIMALS, _LONE = 1e-6, 3, 3


def in_doubt(quantity: str, notices: Iterable[Notice]) -> bool:
    """Whether a warning doubts the unit of a quantity, "position" or "time".

    The limit is wrong by what a position is wrong by, in whichever direction; a force that is wrong
    by a factor cancels, since the limit is in units of the command.
    """
    return any((n.level, n.topic) == ("warning", "units") and quantity in n.about for n in notices)


def not_of_the_position(notices: Iterable[Notice]) -> tuple[Notice, ...]:
    """The same, without doubt of the position's unit: the device's file confirms it."""
    return tuple(
        replace(n, about=tuple(a for a in n.about if a != "position"))
        if (n.level, n.topic) == ("warning", "units")
        else n
        for n in notices
    )


def whole_numbers(recording: Recording) -> list[Notice]:
    """Counts of an encoder or a converter: no device moves by whole metres or radians.

    A force of few levels may be whole: a relay's, a step's.
    """
    notices = []
    levels = 20  # of a force, which may be whole newtons
    if is_whole(recording.force) and len(np.unique(recording.force)) > levels:
        text = (
            f"The forces are whole numbers, from {recording.force.min():g} to "
            f"{recording.force.max():g} {recording.force_unit}: are they counts of a converter? "
            f"Write force=NAME*C[{recording.force_unit}] with the force C of one count."
        )
        notices.append(Notice("warning", "units", text, ("force",)))
    if not is_whole(recording.position):
        return notices
    unit = recording.position_unit
    text = (
        f"The positions are whole numbers, from {recording.position.min():g} to "
        f"{recording.position.max():g} {unit}: are they counts of the encoder? Write "
        f"position=NAME*C with one count C in {unit}, or name their unit, as in position=NAME[mm]."
    )
    return [*notices, Notice("warning", "units", text, ("position",))]


def normalised(recording: Recording) -> list[Notice]:
    """Positions of standard deviation 1, from 0 to 1, or up to 1: scaled by their own size.

    Written in `unit` or in a thousandth of it.  An extreme of exactly one is a chance of a file's
    last digit.
    """
    position, unit = recording.position, recording.position_unit
    for per_unit in (1.0, 1e3):
        how = _scaled_by(per_unit * position)
        if how is not None:
            text = (
                f"The positions {how}: were they normalised before they were written down? The "
                f"limit would be in units of that, and not in {recording.force_unit}/{unit}: "
                "record positions as they are read, or write position=NAME*C with what was divided "
                "by."
            )
            return [Notice("warning", "units", text, ("position",))]
    return []


def _scaled_by(position: Floats) -> str | None:
    """What was made one of these positions, in words; None where nothing shows it."""

    def is_one(value: float) -> bool:
        return bool(abs(value - 1) < _AT_SCALE)

    def lone(value: float) -> bool:
        return bool(np.sum(np.abs(np.abs(position) - value) < _AT_SCALE) <= _LONE)

    size = len(position)
    sd = position.std() * np.array([1.0, np.sqrt(size / (size - 1))])
    if abs(position.mean()) < _AT_SCALE and np.abs(sd - 1).min() < _AT_SCALE:
        return "have a mean of 0 and a standard deviation of 1"
    if np.array_equal(position, np.round(position, _DECIMALS)):
        return None
    low, high = float(position.min()), float(position.max())
    if low == 0 and is_one(high):  # cut off at both ends, too
        return "go from 0 to 1"
    if is_one(max(-low, high)) and lone(1.0):
        return "reach 1, and no farther"
    return None


def is_whole(signal: Floats) -> bool:
    """Whether these are whole numbers, all of them."""
    return np.array_equal(signal, np.round(signal))


def degrees(recording: Recording) -> list[Notice]:
    """Angles in radians that are a round part of 360."""
    turn = steps_of_a_turn(increment_unit(recording.position))
    if recording.position_unit != "rad" or turn is None:
        return []
    text = (
        f"The angles are multiples of {360 / turn:.6g}, and {turn:,} of that are 360: are they in "
        "degrees? Write position=NAME[deg] in --columns."
    )
    # One step in fifty of an encoder in radians is so by chance: where rad is said it may be true.
    assumed = is_assumed("position", recording.notices)
    return [Notice("warning", "units", text, ("position",) if assumed else ())]


def steps_of_a_turn(step: float | None) -> int | None:
    """How many steps are a turn of 360 degrees; None where it is no whole number of them.

    Nor where a file may just have been rounded to such a step, or where they are a turn in radians.
    """
    if step is None or step <= 0:
        return None
    most = 1_000_000  # lines of an encoder, interpolated; beyond, any step is near a part of 360
    digits = step / 10.0 ** np.floor(np.log10(step) + 1e-6)
    if np.abs(digits - [1, 2, 5]).min() < 1e-4 or not 360 / most < step < 1:
        return None

    def whole(turn: float) -> bool:
        return abs(turn / step - round(turn / step)) < 0.01

    return round(360 / step) if whole(360.0) and not whole(2 * np.pi) else None


def implausible_mass(recording: Recording | Etfe, clear: RoughResponse) -> list[Notice]:
    """A device of milligrams or tons: a slip of units, with the factor that makes sense of it."""
    kind = (recording.force_unit, recording.position_unit)
    if kind not in _MASSES:
        return []
    lightest, usual, heaviest, doubted, unit = _MASSES[kind]
    said_nothing = is_assumed("position", recording.notices)
    s = 2j * np.pi * clear.frequency_hz
    mass = float(np.median(np.abs(1 / (s**2 * clear.response))))
    if lightest < mass < (doubted if said_nothing else heaviest):
        return []
    factor = min((1e-6, 1e-3, 1e3, 1e6), key=lambda f: abs(np.log(mass * f / usual)))
    turns = ""
    low, _, high, _, _ = _MASSES["Nm", "rad"]
    if said_nothing and kind == ("N", "m") and low < mass < high:
        turns = " If it turns: force=NAME[Nm],position=NAME[rad]."
    text = (
        f"The device answers as {mass:.2g} {unit} would: a slip of units? With "
        f"{other_units(factor, *kind)} it would be {mass * factor:.2g} {unit}.{turns} If the units "
        "are right, confirm them with a device file that says the mass (--device)."
    )
    return [Notice("warning", "units", text, ("position",))]


def other_units(factor: float, force_unit: str, position_unit: str) -> str:
    """What makes positions `factor` times as small, or forces as large, and how to write it."""
    times = f"{max(factor, 1 / factor):.4g}"
    named = {
        ("m", 1e3): "mm",
        ("m", 1e6): "um",
        ("rad", 1e3): "mrad",
        ("rad", 1e6): "urad",
        ("rad", 180 / np.pi): "deg",
    }.get((position_unit, factor))
    if factor > 1:
        asked = f" (are they in {named}?)" if named else ""
        written = f"position=NAME[{named}]" if named else f"position=NAME*{1 / factor:.3g}"
        scaled = f" (force=NAME[{force_unit}], if they are in {force_unit} already)"
        return (
            f"positions {times} times as small{asked}, as in {written}, or forces {times} times as "
            f"large{scaled if factor in (1e3, 1e6) else ''},"
        )
    asked = f"are they in {position_unit}, and were scaled once too often?"
    milli = f" (are they in m{force_unit}? force=NAME[m{force_unit}])" if factor == 1e-3 else ""
    return (
        f"positions {times} times as large ({asked} position=NAME[{position_unit}]), or forces "
        f"{times} times as small{milli},"
    )
