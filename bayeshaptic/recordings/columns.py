"""Which of a file's arrays is the time, the force and the position: the ``--columns`` mapping."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError, nearest
from bayeshaptic.recordings.readers import Arrays
from bayeshaptic.recordings.readers.numbers import as_numbers
from bayeshaptic.recordings.units import base_unit, is_unit, stem_and_unit, unit_in_name

# What may stand for the force and for the position (`signals.other_outputs`), where it is named.
FORCES, POSITIONS = ("force", "measured_force"), ("position", "velocity", "acceleration")
RECORDING_ROLES = ("time", *FORCES, *POSITIONS)
# Of what a frequency response is: `bayeshaptic.recordings.response.frf_kinds`.
FRF_KINDS = ("gain_db", "receptance_db", "mobility_db", "accelerance_db")
FRF_ROLES = ("frequency", *FRF_KINDS, "phase_deg", "sd", "coherence", "averages")
# What a controller followed; its unit does not matter.
REFERENCE = "reference"
ROLES = (*RECORDING_ROLES, REFERENCE, *FRF_ROLES)

# Headers that need no mapping, with the unit they say.
DEFAULT_HEADERS: dict[str, dict[str, str | None]] = {
    "time": {"time_s": "s"},
    "force": {"force_n": "N", "torque_nm": "Nm", "current_a": "A"},
    "position": {"position_m": "m", "angle_rad": "rad"},
    REFERENCE: {"reference": None, "reference_m": None, "reference_rad": None},
    "frequency": {"frequency_hz": None},
    **{role: {role: None} for role in FRF_ROLES[1:]},
    **{role: {} for role in (*FORCES[1:], *POSITIONS[1:])},
}

# The same in words, for headers that say their unit: "Time (s)", "Force [N]", "position_mm".
_PLAIN_HEADERS = {
    "time": ("time", "t"),
    "force": ("force", "torque", "current"),
    "position": ("position", "angle"),
}

_MOST_LISTED = 20  # arrays of a file in a message, which is one line
_EXAMPLE = "time=t,force=u,position=q"
# In the last part of a name: that of group/channel (mm)/time says nothing of the time.
_IN_BRACKETS = re.compile(r"\s*[(\[](?P<unit>[^()\[\]]+)[)\]](?=[^/.]*$)")
_EXPRESSION = re.compile(
    r"(?P<name>.+?)"
    r"(?:\s*(?P<sign>[*/])\s*(?P<factor>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?))?"
    r"\s*(?:\[(?P<unit>[^\[\]]*)\])?"
)


@dataclass(frozen=True)
class Column:
    """One term of the mapping: ``name``, ``name*factor`` or ``name/factor``, and maybe ``[unit]``.

    Attributes
    ----------
    text : str
        The term as written.
    names : tuple of str
        What the array may be called, most literal first: names may hold the signs of the mapping.
    factors : tuple of float
        The factor that goes with each of the names.
    unit : str or None
    """

    text: str
    names: tuple[str, ...]
    factors: tuple[float, ...]
    unit: str | None


def parse_columns(columns: str | Mapping[str, str] | None) -> dict[str, Column]:
    """The mapping as written: ``"time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]"``.

    Parameters
    ----------
    columns : str, mapping of role to term, or None

    Raises
    ------
    InputError
        For a term without ``=``, an unknown role, a role given twice, or a factor of zero.
    """
    if columns is None:
        return {}
    if isinstance(columns, str):
        terms = [term.partition("=") for term in columns.split(",") if term.strip()]
        pairs = [(role, term) for role, _, term in terms]
    elif isinstance(columns, Mapping):
        pairs = list(columns.items())
    else:
        raise InputError(f"columns must be text like '{_EXAMPLE}', not {columns!r}")
    parsed: dict[str, Column] = {}
    for role, term in ((str(role).strip(), str(term).strip()) for role, term in pairs):
        if role not in ROLES:
            raise InputError(
                f"columns: '{role}' is none of {', '.join(ROLES)}{nearest(role, ROLES)}; "
                f"write {_EXAMPLE}"
            )
        if role in parsed:
            raise InputError(f"columns: '{role}' is given twice")
        if not term:
            raise InputError(f"columns: '{role}' has no name after '='; write {_EXAMPLE}")
        parsed[role] = _parse_term(term)
    return parsed


def _parse_term(term: str) -> Column:
    match = _EXPRESSION.fullmatch(term)
    if match is None:
        raise InputError(
            f"columns: cannot read '{term}'; write name, name*factor or name*factor[unit]"
        )
    name, sign, factor, unit = match.group("name", "sign", "factor", "unit")
    literal = term[: match.start("unit") - 1].strip() if unit is not None else term
    number = float(factor) if factor else 1.0
    if number == 0 or not np.isfinite(number):
        raise InputError(f"columns: the factor in '{term}' must be a number other than zero")
    return Column(
        term, (term, literal, name), (1.0, 1.0, 1 / number if sign == "/" else number), unit
    )


def is_frequency_response(arrays: Arrays, mapping: Mapping[str, Column]) -> bool:
    """Whether a file is a table of a frequency response and not a recording."""
    if any(role in mapping for role in FRF_ROLES):
        return True
    named = any(default_unit("frequency", name)[0] for name in arrays)
    return named and not any(role in mapping for role in RECORDING_ROLES)


def played_by(roles: tuple[str, ...], mapping: Mapping[str, Column], path: Path) -> str:
    """Which of `roles` that stand for one thing the mapping names; the first where it names none.

    Raises
    ------
    InputError
        Where it names several.
    """
    named = [role for role in roles if role in mapping]
    if len(named) > 1:
        raise InputError(f"{path}: columns name both {' and '.join(named)}; leave one of them out")
    return (*named, roles[0])[0]


def name_and_unit(name: str) -> tuple[str, str | None]:
    """``Position (mm)`` or ``Position [mm] axis 1`` as the name and the unit; None without one."""
    for match in reversed(list(_IN_BRACKETS.finditer(name))):
        rest = (name[: match.start()] + name[match.end() :]).strip()
        if rest and is_unit(match["unit"]):
            return rest, match["unit"]
    return name, None


def default_unit(role: str, name: str) -> tuple[bool, str | None]:
    """Whether a header needs no mapping to play a role (force_n, force_N), and the unit it says."""
    plain, headers = name.lower(), DEFAULT_HEADERS[role]
    return plain in headers, headers.get(plain)


def _find(arrays: Arrays, name: str) -> str | None:
    """An array by its name, with or without the unit in brackets after it."""
    if name in arrays:
        return name
    found = [key for key in arrays if name_and_unit(key)[0] == name]
    return found[0] if len(found) == 1 else None


def _unit_times(key: str, factor: float, role: str, path: Path) -> str | None:
    """The unit that a header says, in brackets or as its end, of values times a factor.

    Raises
    ------
    InputError
        Where the header says a multiple, as in mm, and nothing which unit the product is in.
    """
    unit = name_and_unit(key)[1]
    ending = unit_in_name(role, key) if unit is None else None
    unit = unit or ending
    if unit is None or abs(factor) == 1.0 or role not in RECORDING_ROLES:
        return unit
    try:
        base, multiple = base_unit(role, unit)
    except InputError:  # volts times a force constant
        return None
    if ending is not None and base == "A":  # amperes, too
        return None
    if ending is not None and np.isclose(abs(factor), multiple, rtol=1e-3):  # t_us*1e-6
        return base
    if multiple != 1.0:
        raise InputError(
            f"{path}: '{key}' is multiplied by {factor:g}; write which unit that gives, as in "
            f"{role}=...*{factor:g}[{unit}]"
        )
    return unit


def _defaults(arrays: Arrays, role: str) -> dict[str, str | None]:
    """Arrays that say by their names that they play a role, with their units."""
    said = {name: default_unit(role, name) for name in arrays}
    found = {name: unit for name, (is_default, unit) in said.items() if is_default}
    if role == REFERENCE:
        return found
    for key in arrays:
        name, unit = name_and_unit(key)
        plain = name.lower()
        if unit is not None and plain in DEFAULT_HEADERS[role]:
            if base_unit(role, unit) != (DEFAULT_HEADERS[role][plain], 1.0):
                raise InputError(f"'{key}' says two units; rename it")
            found[key] = unit
        elif unit is not None and plain in _PLAIN_HEADERS.get(role, ()):
            found[key] = unit
    if not found:
        ended = {key: stem_and_unit(role, key) for key in arrays}
        plain_headers = _PLAIN_HEADERS.get(role, ())
        found = {k: u for k, (stem, u) in ended.items() if u and stem.lower() in plain_headers}
    return found


def pick(
    arrays: Arrays, role: str, mapping: Mapping[str, Column], path: Path, required: bool = True
) -> tuple[NDArray[np.float64], str | None] | None:
    """The array that plays a role, times its factor, and the unit that was written for it.

    Parameters
    ----------
    arrays : dict
        The file's arrays by name.
    role : str
        One of `ROLES`.
    mapping : mapping
        From `parse_columns`; a role it lacks is looked for under its default headers.
    path : Path
        For messages.
    required : bool
        Otherwise None is handed back where nothing plays the role.

    Raises
    ------
    InputError
        Where the array is not there (the message lists what is), or holds text.
    """
    if role not in mapping:
        defaults = _defaults(arrays, role)
        if len(defaults) > 1:
            raise InputError(
                f"{path}: both {' and '.join(defaults)}; say which with --columns {role}=..."
            )
        for name, unit in defaults.items():
            return as_numbers(arrays[name], f"{path}: '{name}'"), unit
        if not required:
            return None
        raise InputError(
            f"{path}: no column for the {role} ({' or '.join(DEFAULT_HEADERS[role])}); "
            f"the file has {listing(arrays)}; name what to use, as in --columns {_EXAMPLE} "
            f"(bayeshaptic inspect FILE suggests it)"
            + (", or give the sampling period with --period-s" if role == "time" else "")
        )
    column = mapping[role]
    for name, factor in zip(column.names, column.factors, strict=True):
        key = _find(arrays, name)
        if key is not None:
            values = as_numbers(arrays[key], f"{path}: '{key}'")
            # Of the whole term what stands in brackets belongs to the name: Y[0].
            unit = None if key == column.text else column.unit
            return values * factor, unit or _unit_times(key, factor, role, path)
    name = column.names[-1]
    raise InputError(
        f"{path}: no column '{name}' for the {role}{nearest(name, arrays)}; "
        f"the file has {listing(arrays)}"
    )


def column_of(arrays: Arrays, role: str, mapping: Mapping[str, Column]) -> str | None:
    """The name of the array that plays a role; None where none does."""
    names = mapping[role].names if role in mapping else tuple(_defaults(arrays, role))
    return next((key for name in names if (key := _find(arrays, name)) is not None), None)


def listing(arrays: Arrays) -> str:
    """The names of a file's arrays and their lengths, the longest first, single numbers not."""
    names: dict[int, list[str]] = {}
    for name, values in arrays.items():
        if len(values) > 1:
            names.setdefault(id(values), []).append(name)
    lines = [f"{' = '.join(same)} ({len(arrays[same[0]])})" for same in names.values()]
    lines.sort(key=lambda line: -int(line.rpartition("(")[2][:-1]))
    more = len(lines) - _MOST_LISTED
    return ", ".join(lines[:_MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
