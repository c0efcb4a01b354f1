"""Recordings from files and from arrays."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.columns import (
    FORCES,
    POSITIONS,
    REFERENCE,
    Column,
    column_of,
    is_frequency_response,
    listing,
    parse_columns,
    pick,
    played_by,
)
from bayeshaptic.recordings.cut import Cut, Span
from bayeshaptic.recordings.readers import Arrays, read_arrays
from bayeshaptic.recordings.readers.numbers import as_numbers
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.other_outputs import as_command_and_position
from bayeshaptic.recordings.signals.timing import sampling_period
from bayeshaptic.recordings.signals.turns import unwrapped
from bayeshaptic.recordings.units import (
    base_unit,
    choose_units,
    kind_by_names,
    said_by_names,
    says_volts,
)

Columns = str | Mapping[str, str] | None


@at_the_door
def read_recording(
    path: str | os.PathLike[str],
    columns: Columns = None,
    period_s: float | None = None,
    encoder_resolution: float | None = None,
    name: str | None = None,
    kind: str | None = None,
    rows: Span | None = None,
    seconds: Span | None = None,
) -> Recording:
    """A recording from a file: CSV (also gzipped), MAT, HDF5 or NPZ.

    Parameters
    ----------
    path : str or path
    columns : str, mapping or None
        Which array is the time, the force and the position, with factors and units:
        ``"time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]"``, or the same as a mapping.
        Headers ``time_s``, ``force_n`` / ``torque_nm`` / ``current_a`` and ``position_m`` /
        ``angle_rad`` need none. ``velocity`` or ``acceleration`` may stand for the position,
        ``measured_force`` for the force (`bayeshaptic.recordings.signals.other_outputs`).
    period_s : float or None
        Sampling period; None takes it from the time stamps. Given, no time is needed.
    encoder_resolution : float or None
        One encoder count in m or rad.
    name : str or None
        The recording's name in reports; the file's by default.
    kind : {"translational", "rotational"} or None
        Decides for N and m or Nm and rad where no units are written.
    rows : (first, last) or None
        The part to read, in rows counted from 1, both included; None is the file's own end.
    seconds : (from, to) or None
        The part to read, in seconds since the first row.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For anything that cannot be read or used, in one line: file, place and cure.
    """
    path = Path(path)
    mapping = parse_columns(columns)
    arrays = read_arrays(path)
    if is_frequency_response(arrays, mapping):
        raise InputError(
            f"{path}: a table of a frequency response, not a recording; use read_frf or "
            "read_measurement"
        )
    cut = Cut(rows, seconds)
    return recorded(path, arrays, mapping, period_s, encoder_resolution, name, kind, cut)


def recording_of(given: Recording | str | os.PathLike[str]) -> Recording:
    """The recording, read where it is a path."""
    return given if isinstance(given, Recording) else read_recording(given)


@at_the_door
def recording_from_arrays(
    force: ArrayLike,
    position: ArrayLike,
    period_s: float | None = None,
    time: ArrayLike | None = None,
    force_unit: str | None = None,
    position_unit: str | None = None,
    kind: str | None = None,
    name: str = "recording",
    encoder_resolution: float | None = None,
    source: Path | None = None,
    reference: ArrayLike | None = None,
) -> Recording:
    """A recording from arrays in memory.

    Parameters
    ----------
    force, position : array_like, shape (N,)
        Commanded force and measured position; (N, 1) and (1, N) will do.
    period_s : float or None
        Sampling period in seconds, or:
    time : array_like, shape (N,), or None
        Time stamps in seconds.
    force_unit : {"N", "Nm", "A"} or None
    position_unit : {"m", "rad"} or None
    kind : {"translational", "rotational"} or None
        Decides where the units are None; otherwise N and m.
    name : str
    encoder_resolution : float or None
        One encoder count, in the position's unit.
    source : Path or None
        The file, for messages and reports.
    reference : array_like, shape (N,), or None
        What a controller followed, in any unit; used where the recording was made in closed loop.

    Returns
    -------
    Recording

    Raises
    ------
    InputError
        For arrays that differ in length, are empty or hold NaN or infinity (with the row, counted
        from 1), and for time stamps that show no even sampling.
    """
    where = str(source) if source is not None else name
    force = _signal(force, "force", where)
    position = _signal(position, "position", where)
    stamps = None if time is None else _signal(time, "time", where)
    followed = None if reference is None else _signal(reference, "reference", where)
    lengths = {"force": len(force), "position": len(position)}
    if followed is not None:
        lengths["reference"] = len(followed)
    if stamps is not None:
        lengths["time"] = len(stamps)
    if len(set(lengths.values())) > 1:
        counts = ", ".join(f"{role} has {length}" for role, length in lengths.items())
        raise InputError(f"{where}: the arrays differ in length: {counts} samples")
    if not (encoder_resolution is None or 0 < encoder_resolution < np.inf):
        raise InputError(f"{where}: encoder_resolution must be above 0, not {encoder_resolution}")
    timing = sampling_period(stamps, period_s, where)
    unit_of_force, unit_of_position = choose_units(force_unit, position_unit, kind, where)
    angle = unit_of_position == "rad"
    position, notices = unwrapped(position, angle, encoder_resolution, where)
    if timing.rows is not None:
        from bayeshaptic.recordings.signals.gaps import put_back

        force, position, followed = put_back(force, position, followed, timing.rows, where)
    notices += timing.notices
    if force_unit is None and position_unit is None:
        text = (
            f"No units were given: the force is taken to be in {unit_of_force}, the position in "
            f"{unit_of_position}. Say otherwise with --columns, as in position=q[mm]."
        )
        notices += (Notice("note", "units", text, ("force", "position")),)
    return Recording(
        force=force,
        position=position,
        period_s=timing.period_s,
        force_unit=unit_of_force,
        position_unit=unit_of_position,
        name=name,
        encoder_resolution=encoder_resolution,
        time_jitter=timing.jitter,
        source=source,
        notices=notices,
        reference=followed,
    )


def recorded(
    path: Path,
    arrays: Arrays,
    mapping: Mapping[str, Column],
    period_s: float | None,
    encoder_resolution: float | None,
    name: str | None,
    kind: str | None,
    cut: Cut,
) -> Recording:
    """The recording in the arrays of a file; see `read_recording`."""
    signals: dict[str, NDArray[np.float64]] = {}
    units: dict[str, str | None] = {}
    written: dict[str, str | None] = {}
    force, position = played_by(FORCES, mapping, path), played_by(POSITIONS, mapping, path)
    _refuse_shared(arrays, ("time", force, position), mapping, path)
    for role in (force, position, "time"):
        found = pick(arrays, role, mapping, path, required=role != "time" or period_s is None)
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
    signals = cut.apply(signals, period_s, path)
    said = units[position] is not None or units[force] in ("N", "Nm")
    if kind is None and not said and force in mapping and position in mapping:
        kind = kind_by_names(mapping[force].names[-1], mapping[position].names[-1])
    recording = recording_from_arrays(
        signals["force"],
        signals[position],
        period_s=period_s,
        time=signals.get("time"),
        force_unit=units[force],
        position_unit=units[position],
        kind=kind,
        name=name or recording_name(path),
        encoder_resolution=encoder_resolution,
        source=path,
        reference=signals.get(REFERENCE),
    )
    recording = as_command_and_position(recording, force, position)
    bare = {role: mapping[role].names[-1] for role in mapping if mapping[role].unit is None}
    by_names = said_by_names(bare, written, recording.force_unit)
    recording = replace(recording, notices=recording.notices + by_names)
    if units[force] is None and force in mapping and _in_volts(mapping[force]):
        text = (
            f"The force's name, '{mapping[force].text}', says volts, and it is taken to be "
            f"in {recording.force_unit}: stiffness and masses are then wrong by the force of one "
            f"volt, C. Write {force}=NAME*C[{recording.force_unit}] in --columns."
        )
        notices = (*recording.notices, Notice("warning", "units", text, ("force",)))
        recording = replace(recording, notices=notices)
    return recording


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


def _in_volts(force: Column) -> bool:
    """Whether the name says so, and no factor makes a force of it."""
    return force.factors[-1] == 1.0 and says_volts(force.names[-1])


def recording_name(path: Path) -> str:
    """The file's name without its endings: ``lhifam-user`` for ``lhifam-user.csv.gz``."""
    return path.name.removesuffix(".gz").rsplit(".", 1)[0] or path.name


def _signal(values: ArrayLike, what: str, where: str) -> NDArray[np.float64]:
    """One signal: a vector of finite numbers of its own, so that nobody changes it from outside."""
    if np.ma.isMaskedArray(values):
        values = np.ma.filled(values.astype(float), np.nan)
    signal = np.squeeze(as_numbers(np.array(values), f"{where}: {what}"))
    if signal.ndim != 1 or signal.size == 0:
        shape = np.shape(values)
        raise InputError(
            f"{where}: {what} must be one row of samples, not an array of shape {shape}"
        )
    bad = np.flatnonzero(~np.isfinite(signal))
    if len(bad):
        raise InputError(
            f"{where}: {what} is {signal[bad[0]]} in row {bad[0] + 1} ({len(bad)} such rows); "
            "fill them in, or read a part without them, with --rows A:B",
            topic="rows",
        )
    signal.setflags(write=False)
    return signal
