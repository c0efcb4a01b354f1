"""A file as what it is: a recording, or a table of a frequency response."""

from __future__ import annotations

import os
from pathlib import Path

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.recordings.columns import is_frequency_response, parse_columns, pick
from bayeshaptic.recordings.cut import Cut, Span
from bayeshaptic.recordings.from_columns import Said, recorded
from bayeshaptic.recordings.read import Columns
from bayeshaptic.recordings.readers import read_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.frf_table import frf_from_arrays


@at_the_door
def read_measurement(
    path: str | os.PathLike[str],
    columns: Columns = None,
    period_s: float | None = None,
    encoder_resolution: float | None = None,
    name: str | None = None,
    kind: str | None = None,
    default_period_s: float | None = None,
    rows: Span | None = None,
    seconds: Span | None = None,
) -> Recording | Etfe:
    """A recording, or a frequency response where the file's columns are those of one.

    Parameters
    ----------
    path, columns, period_s, encoder_resolution, name, kind, rows, seconds
        See `read_recording`. A frequency response needs a period (see `read_frf`).
    default_period_s : float or None
        The period where the file has no time stamps, as a device file gives it; stamps come before
        it.

    Returns
    -------
    Recording or Etfe

    Raises
    ------
    InputError
        See `read_recording` and `read_frf`.
    """
    path = Path(path)
    mapping = parse_columns(columns)
    arrays = read_arrays(path)
    if is_frequency_response(arrays, mapping):
        if rows is not None or seconds is not None:
            raise InputError(f"{path}: a table of a frequency response has no rows to cut")
        return frf_from_arrays(path, arrays, mapping, period_s or default_period_s, kind=kind)
    if period_s is None and pick(arrays, "time", mapping, path, required=False) is None:
        period_s = default_period_s
    said = Said(mapping, period_s, encoder_resolution, name, kind, Cut(rows, seconds))
    return recorded(path, arrays, said)
