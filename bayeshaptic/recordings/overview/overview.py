"""What is in a file: each column's range, resolution and rate, and what it may be.

The guesses are for a person to look at: by the name first, then by what the numbers do. Time
advances evenly; a position answers to a force, so it is the smoother of the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.checks.units_in_doubt import is_whole, steps_of_a_turn
from bayeshaptic.recordings.columns import (
    POSITIONS,
    REFERENCE,
    default_unit,
    is_frequency_response,
    name_and_unit,
    parse_columns,
    pick,
)
from bayeshaptic.recordings.overview.roles import ColumnFacts, guess_roles, says, says_number
from bayeshaptic.recordings.readers import Arrays, read_arrays
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.recordings.units import base_unit, says_drive, unit_by_name, unit_in_name, units_of

# What turns counts and volts into them.
_FACTORS = {
    "force": "multiply by the force of one, as in *0.01[N]",
    "position": "multiply by the size of one, as in *3.1e-6[m]",
}
# In the line for ``--columns``, where a person must say it: it is refused.
UNIT_TO_SAY = "[UNIT]"
# Periods of loops and of loggers: 25 kHz to 5 Hz.
_PERIODS_S = (4e-5, 0.2)


@dataclass(frozen=True)
class Overview:
    """The columns of a file, longest first, and which may be time, force, position, reference.

    A velocity or an acceleration stands for a position that no name tells of; a table of a
    frequency response has none of them.

    Attributes
    ----------
    path : Path
    columns : tuple of ColumnFacts
    roles : mapping of str to str
        The name of the column that plays each role.
    arrays : mapping of str to ndarray
        Everything in the file, by its name there.
    """

    path: Path
    columns: tuple[ColumnFacts, ...]
    roles: Mapping[str, str]
    arrays: Arrays

    @property
    def of_a_response(self) -> bool:
        """Whether it is a table of a frequency response, which needs no mapping."""
        return is_frequency_response(self.arrays, {})

    @property
    def mapping(self) -> str | None:
        """What to give to ``--columns``; None where no force or no position was found."""
        if "force" not in self.roles or not set(POSITIONS) & set(self.roles):
            return None
        facts = {column.name: column for column in self.columns}
        return ",".join(
            f"{role}={name}{_scale(role, facts[name])}"
            for role, name in sorted(self.roles.items())
            if role != REFERENCE
        )


def overview(path: Path) -> Overview:
    """Look at a file.

    Raises
    ------
    InputError
        See `read_arrays`; also where no column has more than one number.
    """
    arrays = read_arrays(path)
    if all(len(values) < 2 for values in arrays.values()):
        raise InputError(f"{path}: no column has more than one number; record more than a sample")
    seen: dict[int, str] = {}
    for name, values in arrays.items():
        # Of several names the last is the signal's own, where it can be written in a mapping.
        if len(values) > 1 and (id(values) not in seen or not set(name) & set(",[]")):
            seen[id(values)] = name
    facts = [_facts(name, arrays[name]) for name in seen.values()]
    facts.sort(key=lambda one: -one.samples)
    roles = {} if is_frequency_response(arrays, {}) else guess_roles(facts, arrays)
    return Overview(path, tuple(facts), roles, arrays)


def _facts(name: str, values: NDArray[Any]) -> ColumnFacts:
    """What a column's numbers are like; of text and of fewer than three numbers nothing."""
    unit = name_and_unit(name)[1]
    of_no_numbers = ColumnFacts(name, len(values), np.nan, np.nan, None, None, np.nan, unit)
    if values.dtype.kind not in "iufb":
        return of_no_numbers
    most_rows = 500_000  # whose steps are looked at
    whole = np.asarray(values, dtype=float)
    there = np.isfinite(whole)
    signal = whole[:most_rows][there[:most_rows]]
    if len(signal) < 3:
        return of_no_numbers
    steps = np.diff(signal)
    step = float(np.median(steps))
    even = 0.25  # of the period: what varies by more is time only by its name
    advances = (steps >= 0) if says(name, "time") else np.abs(steps - step) < even * step
    is_time = step > 0 and np.mean(advances) > 0.99
    spread = float(np.std(signal))
    return ColumnFacts(
        name,
        len(values),
        float(whole.min(where=there, initial=np.inf)),
        float(whole.max(where=there, initial=-np.inf)),
        increment_unit(signal) if spread > 0 else None,
        step if is_time else None,
        float(np.sqrt(np.mean(steps**2))) / spread if spread > 0 else np.nan,
        unit,
        int(np.count_nonzero(~there)),
        is_whole(signal),
    )


def _scale(role: str, column: ColumnFacts) -> str:
    """The unit to write after a name, where the header has none in brackets.

    By the name, or by what the numbers speak for; where they speak against m and rad it is left to
    be said.
    """
    if column.unit is not None or default_unit(role, column.name)[0]:
        return ""
    if (unit := unit_in_name(role, column.name)) is not None:
        return f"[{unit}]"
    if role == "position" and _is_large(column):
        return UNIT_TO_SAY
    if role in POSITIONS[1:]:
        return UNIT_TO_SAY
    if role == "time":
        units = tuple(_rates(column))
        if len(units) > 1 or _counts_samples(column):
            return UNIT_TO_SAY
        return f"[{units[0]}]" if units and units != ("s",) else ""
    return ""


def _counts_samples(column: ColumnFacts) -> bool:
    """Whether a time may be the number of the sample: it would be milliseconds otherwise."""
    return column.whole and column.period == 1.0 and says_number(column.name)


def _rates(column: ColumnFacts) -> dict[str, float]:
    """The units in which the steps of a time are a usual period, with the rate in Hz."""
    low, high = _PERIODS_S
    periods = {u: (column.period or 0.0) * base_unit("time", u)[1] for u in ("s", "ms", "us", "ns")}
    return {unit: 1 / period for unit, period in periods.items() if low <= period <= high}


def _is_large(column: ColumnFacts) -> bool:
    """Whether these are no metres or radians: neither counts, nor degrees by their steps."""
    if column.whole or max(abs(column.low), abs(column.high)) <= 10:
        return False
    turns = unit_by_name("position", column.name) == "rad"
    return not (turns and steps_of_a_turn(column.resolution))


def doubts(column: ColumnFacts, role: str) -> str:
    """What a person should settle about a column that plays a role; empty where nothing."""
    if role == REFERENCE:
        return f"what a controller followed? Then add ,reference={column.name}"
    if role == "time":
        if (said := _said_of(column)) is not None:
            return said
        if _scale(role, column) != UNIT_TO_SAY:
            return ""
        if _counts_samples(column):
            return (
                "the number of the sample? multiply by the period, as in *0.001[s]; or is it [ms]?"
            )
        rates = (f"{rate:.4g} Hz in {unit}" for unit, rate in _rates(column).items())
        return f"{', '.join(rates)}: write the unit after the name"
    if default_unit(role, column.name)[0]:
        return ""
    if column.missing:
        return f"{column.missing} rows without a number: remove them, or read a part without"
    if column.unit is not None:
        return _factor_for(column.unit, role)
    if (unit := unit_in_name(role, column.name)) is not None:
        return f"in {unit} by its name: say so if it is not"
    if role == "position" and column.whole:
        return f"whole numbers: encoder counts? {_FACTORS[role]}"
    guess = unit_by_name(role, column.name) if role in _FACTORS else None
    if guess == "rad" and (turn := steps_of_a_turn(column.resolution)):
        return f"{turn:,} steps to 360: degrees? Write [deg] after the name"
    if role == "position" and _is_large(column):
        return "large for metres or radians: write the unit, as in [mm] or [deg]"
    if role == "force" and column.whole:
        return f"whole numbers: converter counts? {_FACTORS[role]}"
    if role == "force" and (drive := says_drive(column.name)):
        return f"{drive[0]}? {_FACTORS[role]}"
    units = units_of(role)
    guess = "rad] or [deg" if guess == "rad" else guess
    perhaps = f", perhaps [{guess}]" if guess else ""
    return f"unit not known{perhaps}: write it after the name, {units}"


def _said_of(column: ColumnFacts) -> str | None:
    """Where a time's name says its unit: what to doubt of that, empty where nothing."""
    by_name = default_unit("time", column.name)[1] or unit_in_name("time", column.name)
    unit = column.unit or by_name
    if unit is None or not column.period:
        return None
    period_s, usual = column.period * base_unit("time", unit)[1], _rates(column)
    if unit in usual or not usual:
        return ""
    perhaps = " or ".join(f"{column.name}[{one}]" for one in usual)
    return f"one sample every {period_s:g} s by its name, which no loop has: time={perhaps}?"


def is_guess(column: ColumnFacts, role: str) -> bool:
    """Whether a role was given by what the numbers do, and the name says nothing of it."""
    return role in ("force", "position") and not says(column.name, role)


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
