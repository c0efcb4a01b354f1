"""What is in a file: each column's range, resolution and rate, and what it may be.

The guesses are for a person to look at: by the name first, then by what the numbers do. Time
advances evenly; a position answers to a force, so it is the smoother of the two.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.columns import DEFAULT_HEADERS, name_and_unit, parse_columns, pick
from bayeshaptic.recordings.readers import Arrays, read_arrays
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.units import (
    base_unit,
    is_of_another_role,
    says_volts,
    unit_by_name,
    unit_in_name,
)
from bayeshaptic.recordings.units_in_doubt import is_whole, steps_of_a_turn

# Words that names of such signals have, in the order in which they are believed.
_WORDS = {
    "time": r"^t$|time|zeit|stamp|^sec|\bt_?\(?m?s",
    "force": r"force|torque|kraft|moment|current|strom|^u$|tau|^f$|^i$|iq|cmd|command|volt|^vir",
    "position": r"pos|angle|winkel|weg|theta|^q|^y$|^x$|enc|phi|displ",
}
# What turns counts and volts into them.
_FACTORS = {
    "force": "multiply by the force of one, as in *0.01[N]",
    "position": "multiply by the size of one, as in *3.1e-6[m]",
}
# In the line for ``--columns``, where a person must say it: it is refused.
UNIT_TO_SAY = "[UNIT]"
# Behind these a signal is not what was commanded, or not a position.
_OTHERS = r"vel|speed|acc|err|omega|dot|status|index|count(er)?$|(^|[/._ ])d(x|y|q|phi|theta)\b"


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


@dataclass(frozen=True)
class Overview:
    """The columns of a file, longest first, and which may be time, force and position."""

    path: Path
    columns: tuple[ColumnFacts, ...]
    roles: Mapping[str, str]
    arrays: Arrays

    @property
    def mapping(self) -> str | None:
        """What to give to ``--columns``; None where no force or no position was found."""
        if not {"force", "position"} <= set(self.roles):
            return None
        facts = {column.name: column for column in self.columns}
        return ",".join(
            f"{role}={name}{_scale(role, facts[name])}" for role, name in sorted(self.roles.items())
        )


def overview(path: Path) -> Overview:
    """Look at a file.

    Raises
    ------
    InputError
        See `read_arrays`.
    """
    arrays = read_arrays(path)
    seen: dict[int, str] = {}
    for name, values in arrays.items():
        # Of several names the last is the signal's own, where it can be written in a mapping.
        if len(values) > 1 and (id(values) not in seen or not set(name) & set(",[]")):
            seen[id(values)] = name
    facts = [_facts(name, arrays[name]) for name in seen.values()]
    facts.sort(key=lambda one: -one.samples)
    return Overview(path, tuple(facts), _roles(facts), arrays)


def _facts(name: str, values: NDArray[Any]) -> ColumnFacts:
    unit = name_and_unit(name)[1]
    if values.dtype.kind not in "iufb":
        return ColumnFacts(name, len(values), np.nan, np.nan, None, None, np.nan, unit)
    most_rows = 500_000  # that are looked at
    signal = np.asarray(values[:most_rows], dtype=float)
    missing = int(np.sum(~np.isfinite(signal)))
    signal = signal[np.isfinite(signal)]
    if len(signal) < 3:
        return ColumnFacts(name, len(values), np.nan, np.nan, None, None, np.nan, unit)
    steps = np.diff(signal)
    step = float(np.median(steps))
    even = 0.25  # of the period: what varies by more is time only by its name
    advances = (steps >= 0) if _says(name, "time") else np.abs(steps - step) < even * step
    is_time = step > 0 and np.mean(advances) > 0.99
    spread = float(np.std(signal))
    return ColumnFacts(
        name,
        len(values),
        float(signal.min()),
        float(signal.max()),
        increment_unit(signal) if spread > 0 else None,
        step if is_time else None,
        float(np.sqrt(np.mean(steps**2))) / spread if spread > 0 else np.nan,
        unit,
        missing,
        is_whole(signal),
    )


def _roles(facts: list[ColumnFacts]) -> dict[str, str]:
    """Time by its even steps; force and position among the signals of the same length."""
    roles: dict[str, str] = {}
    clocks = [one for one in facts if one.period is not None]
    if clocks:
        roles["time"] = min(clocks, key=lambda one: not _says(one.name, "time")).name
    length = next((one.samples for one in facts if one.name == roles.get("time")), None)
    signals = [
        one
        for one in facts
        if one.period is None
        and one.roughness > 0
        and (length is None or one.samples == length)
        and not re.search(_OTHERS, one.name, re.I)
    ]
    for role, sign in (("force", -1), ("position", 1)):
        free = [
            one
            for one in signals
            if one.name not in roles.values()
            and not (one.unit and is_of_another_role(role, one.unit))
        ]
        other = "position" if role == "force" else "force"
        # By the name: of several the roughest, which is nearest to where the force acts. Without
        # one the roughest is the force, and the smoothest the position.
        if named := [one for one in free if _says(one.name, role)]:
            roles[role] = max(named, key=lambda one: one.roughness).name
        elif unnamed := [one for one in free if not _says(one.name, other)]:
            roles[role] = min(unnamed, key=lambda one: sign * one.roughness).name
    return roles


def _says(name: str, role: str) -> bool:
    """Whether a name tells the role: its last part, or an earlier one where that says nothing."""
    for part in reversed(re.split(r"[/.]", name_and_unit(name)[0])):
        says = {each for each, words in _WORDS.items() if re.search(words, part, re.I)}
        if says:
            return role in says
    return False


def _scale(role: str, column: ColumnFacts) -> str:
    """The unit to write after a name, where the header has none in brackets.

    By the name, or by what the numbers speak for; where they speak against m and rad it is left to
    be said.
    """
    if column.unit is not None or column.name in DEFAULT_HEADERS[role]:
        return ""
    if (unit := unit_in_name(role, column.name)) is not None:
        return f"[{unit}]"
    if role == "position" and _is_large(column):
        return UNIT_TO_SAY
    if role == "time" and column.period is not None:
        # Loops run at 100 Hz to 20 kHz.
        for unit, factor in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
            if 4e-5 <= column.period * factor <= 1.1e-2:
                return "" if unit == "s" else f"[{unit}]"
    return ""


def _is_large(column: ColumnFacts) -> bool:
    """Whether these are no metres or radians: neither counts, nor degrees by their steps."""
    if column.whole or max(abs(column.low), abs(column.high)) <= 10:
        return False
    turns = unit_by_name("position", column.name) == "rad"
    return not (turns and steps_of_a_turn(column.resolution))


def doubts(column: ColumnFacts, role: str) -> str:
    """What a person should settle about a column that plays a role; empty where nothing."""
    if role == "time" or column.name in DEFAULT_HEADERS[role]:
        return ""
    if column.missing:
        return f"{column.missing} rows without a number: fill them in, or read a part without them"
    if column.unit is not None:
        return _factor_for(column.unit, role)
    if (unit := unit_in_name(role, column.name)) is not None:
        return f"in {unit} by its name: say so if it is not"
    if role == "position" and column.whole:
        return f"whole numbers: encoder counts? {_FACTORS[role]}"
    guess = unit_by_name(role, column.name)
    if guess == "rad" and (turn := steps_of_a_turn(column.resolution)):
        return f"{turn:,} steps to 360: degrees? Write [deg] after the name"
    if role == "position" and _is_large(column):
        return "large for metres or radians: write the unit, as in [mm] or [deg]"
    if role == "force" and column.whole:
        return f"whole numbers: converter counts? {_FACTORS[role]}"
    if role == "force" and says_volts(column.name):
        return f"volts? {_FACTORS[role]}"
    units = "[N], [Nm] or [A]" if role == "force" else "[m], [mm], [rad] or [deg]"
    guess = "rad] or [deg" if guess == "rad" else guess
    perhaps = f", perhaps [{guess}]" if guess else ""
    return f"unit not known{perhaps}: write it after the name, {units}"


def _factor_for(unit: str, role: str) -> str:
    """What to write after a name whose header has a unit that is none of the role."""
    try:
        base_unit(role, unit)
    except InputError:
        return f"in {unit}: {_FACTORS[role]}"
    return ""


def unit_of(found: Overview, role: str, term: str) -> str | None:
    """The base unit of what a term of ``--columns`` names; None where nothing says it.

    Raises
    ------
    InputError
        Where the file has no such column of numbers, or the unit is none of that role.
    """
    _, unit = pick(found.arrays, role, parse_columns({role: term}), found.path) or ([], None)
    return None if unit is None else base_unit(role, unit)[0]
