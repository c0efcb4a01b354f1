"""A recording from the columns of a file, by what a caller says of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.columns import (
    FORCES,
    POSITIONS,
    REFERENCE,
    Column,
    column_of,
    listing,
    pick,
    played_by,
)
from bayeshaptic.recordings.cut import Cut
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.readers import Arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.other_outputs import as_command_and_position
from bayeshaptic.recordings.units import base_unit, kind_by_names, said_by_names, says_drive
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Said:
    """What a caller says of a file, besides where it is; see `read_recording`.

    Attributes
    ----------
    mapping : mapping of str to Column
        Which array plays which role.
    period_s : float or None
    encoder_resolution : float or None
    name : str or None
    kind : str or None
    cut : Cut
    """

    mapping: Mapping[str, Column]
    period_s: float | None
    encoder_resolution: float | None
    name: str | None
    kind: str | None
    cut: Cut


def recorded(path: Path, arrays: Arrays, said: Said) -> Recording:
    """The recording in the arrays of a file.

    Parameters
    ----------
    path : Path
    arrays : mapping of str to ndarray
        What the file holds, by name.
    said : Said
    """
    mapping = said.mapping
    force, position = played_by(FORCES, mapping, path), played_by(POSITIONS, mapping, path)
    _refuse_shared(arrays, ("time", force, position), mapping, path)
    signals: dict[str, Floats] = {}
    written: dict[str, str | None] = {}
    units: dict[str, str | None] = {}
    for role in (force, position, "time"):
        needed = role != "time" or said.period_s is None
        found = pick(arrays, role, mapping, path, required=needed)
        if found is None:
            continue
        values, unit = found
        written[role] = unit
        units[role], factor = (None, 1.0) if unit is None else base_unit(role, unit)
        signals[role] = values * factor if factor != 1.0 else values
    signals["force"] = signals.pop(force)
    followed = pick(arrays, REFERENCE, mapping, path, required=False)
    if followed is not None:
        signals[REFERENCE] = followed[0]
    signals = said.cut.apply(signals, said.period_s, path)
    _refuse_clocks_of_their_own(signals["force"], signals[position], path)
    kind = said.kind
    known = units[position] is not None or units[force] in ("N", "Nm")
    if kind is None and not known and force in mapping and position in mapping:
        kind = kind_by_names(mapping[force].names[-1], mapping[position].names[-1])
    recording = recording_from_arrays(
        signals["force"],
        signals[position],
        period_s=said.period_s,
        time=signals.get("time"),
        force_unit=units[force],
        position_unit=units[position],
        kind=kind,
        name=said.name or recording_name(path),
        encoder_resolution=said.encoder_resolution,
        source=path,
        reference=signals.get(REFERENCE),
    )
    recording = as_command_and_position(recording, force, position)
    bare = {role: mapping[role].names[-1] for role in mapping if mapping[role].unit is None}
    notices = said_by_names(bare, written)
    if units[force] is None and force in mapping:
        notices = (*notices, *_of_a_drive(force, mapping[force], recording.force_unit))
    return replace(recording, notices=recording.notices + notices)


def _refuse_clocks_of_their_own(force: Floats, position: Floats, path: Path) -> None:
    """Refuse signals that alternate, as two topics in one table: what belongs together is open."""
    one, other = np.isfinite(force), np.isfinite(position)
    if one.any() and other.any() and len(one) == len(other) and not (one & other).any():
        raise InputError(
            f"{path}: no row has both the force and the position ({one.sum()} rows have the one, "
            f"{other.sum()} the other), as where two logs are merged by their time; write a row "
            "for each sampling period, with the force and the position that was read for it",
            topic="rows",
        )


def _of_a_drive(role: str, force: Column, unit: str) -> tuple[Notice, ...]:
    """A warning where the force's name says volts, or a duty, and no factor makes a force of it."""
    said = says_drive(force.names[-1])
    if force.factors[-1] != 1.0 or said is None:
        return ()
    text = (
        f"The force's name, '{force.text}', says {said[0]}, and it is taken to be "
        f"in {unit}: stiffness and masses are then wrong by the force of {said[1]}, "
        f"C. Write {role}=NAME*C[{unit}] in --columns."
    )
    return (Notice("warning", "units", text, ("force",)),)


def _refuse_shared(
    arrays: Arrays, roles: tuple[str, ...], mapping: Mapping[str, Column], path: Path
) -> None:
    """Refuse one column that is to be two things: the position would answer to itself."""
    played: dict[str, str] = {}
    for role in roles:
        key = column_of(arrays, role, mapping)
        if key is not None and played.setdefault(key, role) != role:
            raise InputError(
                f"{path}: '{key}' is given as the {played[key]} and as the {role}; name another "
                f"column for one of them (the file has {listing(arrays)})",
                topic="columns",
            )


def recording_name(path: Path) -> str:
    """The file's name without its endings: ``lhifam-user`` for ``lhifam-user.csv.gz``."""
    return path.name.removesuffix(".gz").rsplit(".", 1)[0] or path.name
