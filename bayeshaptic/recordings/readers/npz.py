"""NumPy archives."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.numbers import NO_NUMBERS
from bayeshaptic.recordings.readers.reader import Arrays, Reader, is_signal, refuse_size, vectors


def read_npz(path: Path) -> Arrays:
    """The vectors of an NPZ file; arrays of Python objects are named, and never unpickled.

    Raises
    ------
    InputError
        For a file that is not an NPZ archive, is damaged, or claims more than can be read.
    """
    found: Arrays = {}
    name = "the archive"
    # zipfile and NumPy meet damaged files with whatever exception their parsers run into.
    try:
        with zipfile.ZipFile(path) as archive:
            for name in (one for one in archive.namelist() if one.endswith(".npy")):
                with archive.open(name) as file:
                    found.update(_read(file, path, name.removesuffix(".npy")))
    except InputError:
        raise
    except zipfile.BadZipFile as error:
        raise InputError(f"{path}: not an NPZ file, or one that is damaged ({error})") from None
    except Exception as error:
        raise InputError(
            f"{path}: {name} is damaged ({type(error).__name__}: {' '.join(str(error).split())})"
        ) from None
    return found if any(values.dtype.kind != "U" for values in found.values()) else {}


def _read(file: IO[Any], path: Path, name: str) -> Arrays:
    version = npy.read_magic(file)
    read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, by_columns, dtype = read_header(file)
    if dtype.kind in "Oc":
        return {name: np.array([NO_NUMBERS])}
    if dtype.kind not in "iufbmM" or not is_signal(shape):
        return {}
    refuse_size(shape, f"{path}: '{name}'")
    count = int(np.prod(shape, dtype=np.int64))
    content = file.read(count * dtype.itemsize)
    values = np.frombuffer(content, dtype, count).reshape(shape, order="F" if by_columns else "C")
    if dtype.kind in "mM":  # dates and durations, in seconds since the first
        values = (values - values.flat[0]) / np.timedelta64(1, "s")
    return vectors(name, values)


READER = Reader("NPZ", (".npz",), read_npz)
