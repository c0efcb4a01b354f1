"""Units that a recording itself makes doubtful."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.signals.rough_response import RoughResponse
from bayeshaptic.types import Floats

_FORCE = "The force"  # how warnings begin that speak of it alone
# Mass of a device as its motor feels it: the lightest, a usual and the heaviest one; and from where
# on it is doubted if nobody said the units, since what is a thousand times too heavy gets a limit
# that is a thousand times too high.
_MASSES = {
    ("N", "m"): (3e-3, 0.5, 500.0, 50.0, "kg"),
    ("Nm", "rad"): (1e-7, 1e-3, 10.0, 0.3, "kg m^2"),
}


def position_is_in_doubt(notices: Iterable[Notice]) -> bool:
    """Whether nobody said the units, and a warning speaks against the position's.

    The limit is wrong by what a position is wrong by, in whichever direction; a force that is wrong
    by a factor cancels, since the limit is in units of the command.
    """
    others = [n for n in notices if n.topic == "units" and not n.text.startswith(_FORCE)]
    return {"note", "warning"} <= {notice.level for notice in others}


def mixed_units(recording: Recording) -> list[Notice]:
    """A force and a position that are not of one kind of motion."""
    if (recording.force_unit, recording.position_unit) not in (("N", "rad"), ("Nm", "m")):
        return []
    text = (
        f"{_FORCE} is in {recording.force_unit} and the position in {recording.position_unit}: "
        f"stiffness is then in {recording.stiffness_unit}, and masses are not in kg or kg m^2. "
        "Give the units with --columns, as in force=NAME[Nm]."
    )
    return [Notice("warning", "units", text)]


def whole_numbers(recording: Recording) -> list[Notice]:
    """Counts of an encoder or a converter: no device moves by whole metres or radians.

    A force of few levels may be whole: a relay's, a step's.
    """
    notices = []
    levels = 20  # of a force, which may be whole newtons
    if is_whole(recording.force) and len(np.unique(recording.force)) > levels:
        text = (
            f"{_FORCE}s are whole numbers, from {recording.force.min():g} to "
            f"{recording.force.max():g} {recording.force_unit}: are they counts of a converter? "
            f"Write force=NAME*C[{recording.force_unit}] with the force C of one count."
        )
        notices.append(Notice("warning", "units", text))
    if not is_whole(recording.position):
        return notices
    unit = recording.position_unit
    text = (
        f"The positions are whole numbers, from {recording.position.min():g} to "
        f"{recording.position.max():g} {unit}: are they counts of the encoder? Write "
        f"position=NAME*C with one count C in {unit}, or name their unit, as in position=NAME[mm]."
    )
    return [*notices, Notice("warning", "units", text)]


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
    return [Notice("warning", "units", text)]


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


def implausible_mass(recording: Recording, clear: RoughResponse) -> list[Notice]:
    """A device of milligrams or tons: a slip of units, with the factor that makes sense of it."""
    kind = (recording.force_unit, recording.position_unit)
    if kind not in _MASSES:
        return []
    lightest, usual, heaviest, doubted, unit = _MASSES[kind]
    said_nothing = any(n.topic == "units" for n in recording.notices)
    s = 2j * np.pi * clear.frequency_hz
    mass = float(np.median(np.abs(1 / (s**2 * clear.response))))
    if lightest < mass < (doubted if said_nothing else heaviest):
        return []
    factor = min((1e-6, 1e-3, 1e3, 1e6), key=lambda f: abs(np.log(mass * f / usual)))
    smaller, larger = ("small", "large") if factor > 1 else ("large", "small")
    named = {1e3: "mm", 1e6: "um"}.get(factor) if recording.position_unit == "m" else None
    asked = f" (are they in {named}?)" if named else ""
    term = f"[{named}]" if named else f"*{1 / factor:g}[{recording.position_unit}]"
    turns = ""
    low, _, high, _, _ = _MASSES["Nm", "rad"]
    if said_nothing and kind == ("N", "m") and low < mass < high:
        turns = " If it turns: force=NAME[Nm],position=NAME[rad]."
    times = max(factor, 1 / factor)
    text = (
        f"The device answers as {mass:.2g} {unit} would: a slip of units? With positions {times:g} "
        f"times as {smaller}{asked}, or forces {times:g} times as {larger}, it would be "
        f"{mass * factor:.2g} {unit}. Give the units with --columns, as in position=NAME{term}."
    )
    return [Notice("warning", "units", text + turns)]
