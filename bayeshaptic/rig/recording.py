"""What the bench records, and files of it."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.files import whole_file
from bayeshaptic.rig.bench import Bench
from bayeshaptic.rig.dynamics.plant import Array

COLUMNS = {"N": ("time_s", "force_n", "position_m"), "Nm": ("time_s", "torque_nm", "angle_rad")}


@dataclass(frozen=True)
class SimulatedRecording:
    """A recording from the bench, and what really happened.

    Attributes
    ----------
    time_s, force, position : ndarray, shape (N,)
        As written down by the logger: commanded force, measured position.
    true_position : ndarray, shape (M,)
        Position in front of the encoder (behind an analogue filter) at the sample instants, without
        noise; M is larger than N where samples were dropped.
    hand_force : ndarray, shape (M,)
        Tremor and wander.
    period_s : float
    force_unit, position_unit : str
    bench : Bench
        The truth.
    """

    time_s: Array = field(repr=False)
    force: Array = field(repr=False)
    position: Array = field(repr=False)
    true_position: Array = field(repr=False)
    hand_force: Array = field(repr=False)
    period_s: float
    force_unit: str
    position_unit: str
    bench: Bench

    @property
    def signals(self) -> dict[str, Any]:
        """What `bayeshaptic.recording_from_arrays` takes: signals, period and units."""
        names = ("force", "position", "period_s", "force_unit", "position_unit")
        return {name: getattr(self, name) for name in names}

    @property
    def columns(self) -> dict[str, Array]:
        """Time, force and position by the names that they have in files."""
        names = COLUMNS[self.force_unit]
        return dict(zip(names, (self.time_s, self.force, self.position), strict=True))


def write_recording(path: str | os.PathLike[str], recording: SimulatedRecording) -> Path:
    """Write a recording; the file is complete or absent.

    Parameters
    ----------
    path : path
        Ending in .csv, .csv.gz, .npz, .h5, .hdf5 or .mat (version 5). The columns are called
        time_s, force_n and position_m, or time_s, torque_nm and angle_rad.
    recording : SimulatedRecording

    Returns
    -------
    Path

    Raises
    ------
    InputError
        For another ending, or a place that cannot be written to.
    """
    path = Path(path)
    suffix = next((end for end in WRITERS if path.name.lower().endswith(end)), None)
    if suffix is None:
        raise InputError(f"{path}: cannot write this kind of file; use {', '.join(WRITERS)}")
    try:
        with whole_file(path) as partial:
            WRITERS[suffix](partial, recording)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
    return path


def _decimals(grid: float, values: Array) -> int:
    """Decimals that keep counts to a ten-thousandth, or nine digits where there is none."""
    size = grid / 1e4 if grid > 0 else float(np.max(np.abs(values), initial=0.0)) * 1e-9
    return int(np.clip(np.ceil(-np.log10(size)), 0, 18)) if size > 0 else 1


def _write_csv(path: Path, recording: SimulatedRecording) -> None:
    import gzip

    names = ",".join(recording.columns)
    columns = np.column_stack(list(recording.columns.values()))
    grids = (recording.period_s, 0.0, recording.bench.resolution)
    formats = [
        f"%.{_decimals(grid, values)}f" for grid, values in zip(grids, columns.T, strict=True)
    ]
    lines = [",".join(_short(f % v) for f, v in zip(formats, row, strict=True)) for row in columns]
    content = "\n".join([names, *lines, ""]).encode()
    # No time in the gzip header: the same recording is the same file.
    path.write_bytes(gzip.compress(content, 9, mtime=0) if path.name.endswith("gz") else content)


def _short(number: str) -> str:
    """Without zeros at the end."""
    short = number.rstrip("0").rstrip(".") if "." in number else number
    return "0" if short == "-0" else short


def _write_npz(path: Path, recording: SimulatedRecording) -> None:
    columns: dict[str, Any] = dict(recording.columns)
    np.savez_compressed(path, **columns)


def _write_hdf5(path: Path, recording: SimulatedRecording) -> None:
    import h5py

    # In memory first: the HDF5 library does not survive a disk or a quota that is full.
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        for name, values in recording.columns.items():
            file.create_dataset(name, data=values, compression="gzip")
    path.write_bytes(content.getbuffer())


def _write_mat(path: Path, recording: SimulatedRecording) -> None:
    import scipy.io

    scipy.io.savemat(path, dict(recording.columns), do_compression=True, oned_as="column")


WRITERS: dict[str, Callable[[Path, SimulatedRecording], None]] = {
    ".csv": _write_csv,
    ".csv.gz": _write_csv,
    ".npz": _write_npz,
    ".h5": _write_hdf5,
    ".hdf5": _write_hdf5,
    ".mat": _write_mat,
}
