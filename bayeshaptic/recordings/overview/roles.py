"""Which columns may be time, force and position: by their names, then by what the numbers do."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.columns import POSITIONS, REFERENCE, name_and_unit
from bayeshaptic.recordings.readers import Arrays
from bayeshaptic.recordings.units import is_of_another_role, unit_in_name

# Words that names of such signals have, in the order in which they are believed.
_WORDS = {
    "time": r"^t$|time|zeit|stamp|^sec|\bt_?\(?m?s",
    "force": r"force|torque|kraft|moment|current|strom|^u$|tau|^f$|^i$|iq|cmd|command|^vir"
    r"|volt|spannung|pwm|duty|effort|control",
    "position": r"pos|angle|winkel|weg|theta|^q|^y$|^x$|enc|phi|displ",
    "velocity": r"vel|speed|omega|rpm|(^|[/._ ])d(x|y|q|phi|theta)\b",
    "acceleration": r"acc",
}
# What a controller followed: no force where its name tells of none, and no measured position.
_FOLLOWED = r"ref|target|desired|set.?point|soll|goal|demand|cmd|command"
_MEASURED = r"meas|actual|feedback|sens|(^|[_ ])(act|fb|adc|mon)([_ ]|$)"
# Behind these a signal is not what was commanded, or not a position.
_OTHERS = r"vel|speed|acc|err|omega|dot|status|index|count(er)?$|(^|[/._ ])d(x|y|q|phi|theta)\b"
# Of a time: it counts samples, or ticks of a clock.
_NUMBERS = r"sampl|index|count|tick|number|nummer|(^|[_ ])(n|k|no|nr|row|step)$"


@dataclass(frozen=True)
class ColumnFacts:
    """What one column of a file looks like.

    Attributes
    ----------
    name : str
    samples : int
    low, high : float
        Range; NaN where it holds text.
    resolution : float or None
        Common divisor of its increments: an encoder count, or the rounding of the file.
    period : float or None
        Median step, where the column advances evenly as time does.
    roughness : float
        Root mean square of its steps over its standard deviation: 1.4 is white noise.
    unit : str or None
        From the header.
    missing : int
        How many are no number.
    whole : bool
        Whether all are whole numbers.
    """

    name: str
    samples: int
    low: float
    high: float
    resolution: float | None
    period: float | None
    roughness: float
    unit: str | None
    missing: int = 0
    whole: bool = False


def guess_roles(facts: list[ColumnFacts], arrays: Arrays) -> dict[str, str]:
    """Time by its even steps; force and position among the signals of the same length.

    Where no name tells of a position, one that does of a velocity stands before any other signal
    but its own integral, and one that does of an acceleration behind them.
    """
    roles: dict[str, str] = {}
    clocks = [one for one in facts if one.period is not None]
    if clocks:
        roles["time"] = min(clocks, key=lambda one: not says(one.name, "time")).name
    length = next((one.samples for one in facts if one.name == roles.get("time")), None)
    moving = [
        one
        for one in facts
        if one.period is None and one.roughness > 0 and (length is None or one.samples == length)
    ]
    followed = [one for one in moving if _is_followed(one.name)]
    signals = [
        one for one in moving if one not in followed and not re.search(_OTHERS, one.name, re.I)
    ]
    for role, sign in (("force", -1), ("position", 1)):
        free = [
            one
            for one in signals
            if one.name not in roles.values() and not _is_of_another_role(role, one)
        ]
        other = "position" if role == "force" else "force"
        # By the name: of several the roughest, which is nearest to where the force acts, and no
        # measured force beside a commanded one. Without a name the roughest is the force, and the
        # smoothest the position.
        if named := [one for one in free if says(one.name, role)]:
            commands = [one for one in named if role == "position" or not is_measured(one.name)]
            roles[role] = max(commands or named, key=lambda one: one.roughness).name
            continue
        unnamed = [one for one in free if not says(one.name, other)]
        if role == "position" and (speed := _measured("velocity", moving)):
            unnamed = [one for one in unnamed if _is_integral(arrays[one.name], arrays[speed])]
            if not unnamed:
                roles["velocity"] = speed
        if unnamed:
            roles[role] = min(unnamed, key=lambda one: sign * one.roughness).name
    if not set(roles) & set(POSITIONS) and (found := _measured("acceleration", moving)):
        roles["acceleration"] = found
    if followed:
        roles[REFERENCE] = min(followed, key=lambda one: says(one.name, "velocity")).name
    return roles


def is_measured(name: str) -> bool:
    """Whether a name tells of a sensor: ``motor_measured_current``, ``torque_fb``."""
    return re.search(_MEASURED, name_and_unit(name)[0], re.I) is not None


def _is_followed(name: str) -> bool:
    """Whether a name tells of what a controller followed: ``target_pos``, not ``torque_ref``."""
    last = re.split(r"[/.]", name_and_unit(name)[0])[-1]
    if not re.search(_FOLLOWED, last, re.I):
        return False
    bare = re.sub(r"(?i)cmd|command(ed)?|control(ler)?", "", last)
    of_motion = any(says(bare, role) or unit_in_name(role, last) for role in POSITIONS)
    return of_motion or not says(last, "force")


def _is_of_another_role(role: str, column: ColumnFacts) -> bool:
    """Whether a column's unit, in brackets or at its name's end, is none of this role."""
    if column.unit is not None:
        return is_of_another_role(role, column.unit)
    others = {"force", *POSITIONS} - {role}
    said = (unit_in_name(other, column.name) for other in others)
    return unit_in_name(role, column.name) is None and any(len(unit or "") > 1 for unit in said)


def _measured(role: str, moving: list[ColumnFacts]) -> str | None:
    """The first column whose name tells of a measured velocity, or acceleration."""
    not_measured = rf"err|{_FOLLOWED}"
    names = (one.name for one in moving if says(one.name, role))
    return next((name for name in names if not re.search(not_measured, name, re.I)), None)


def _is_integral(position: NDArray[Any], speed: NDArray[Any]) -> bool:
    """Whether a signal goes as far in 20 samples as the other's sum over them says, by its sign."""
    span, least = 20, 0.9  # coarse counts and a filtered speed agree as well
    if len(speed) < 2 * span:
        return False
    way = position[span:].astype(float) - position[:-span]
    summed = np.cumsum(speed.astype(float))
    expected = summed[span:] - summed[:-span]
    good = np.isfinite(way) & np.isfinite(expected)
    if not good.any() or min(np.ptp(way[good]), np.ptp(expected[good])) == 0:
        return False
    return bool(abs(np.corrcoef(way[good], expected[good])[0, 1]) > least)


def says_number(name: str) -> bool:
    """Whether a name tells of a number that counts."""
    return bool(re.search(_NUMBERS, name_and_unit(name)[0], re.I))


def says(name: str, role: str) -> bool:
    """Whether a name tells the role: its last part, or an earlier one where that says nothing."""
    for part in reversed(re.split(r"[/.]", name_and_unit(name)[0])):
        says = {each for each, words in _WORDS.items() if re.search(words, part, re.I)}
        if says:
            return role in says
    return False
