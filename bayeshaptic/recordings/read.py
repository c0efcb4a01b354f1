"""Recordings from files."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.recordings.columns import is_frequency_response, parse_columns
from bayeshaptic.recordings.cut import Cut, Span
from bayeshaptic.recordings.from_columns import Said, recorded
from bayeshaptic.recordings.readers import read_arrays
from bayeshaptic.recordings.recording import Recording

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
    said = Said(mapping, period_s, encoder_resolution, name, kind, Cut(rows, seconds))
    return recorded(path, arrays, said)


def recording_of(given: Recording | str | os.PathLike[str]) -> Recording:
    """The recording, read where it is a path."""
    return given if isinstance(given, Recording) else read_recording(given)
