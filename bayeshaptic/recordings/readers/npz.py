"""NumPy archives."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.reader import Arrays, Reader, vectors


def read_npz(path: Path) -> Arrays:
    """The vectors of an NPZ file; arrays of Python objects are passed over.

    Raises
    ------
    InputError
        For a file that is not an NPZ archive.
    """
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path}: not an NPZ file, or one that is cut off")
    found: Arrays = {}
    with np.load(path, allow_pickle=False) as archive:
        for name in archive.files:
            try:
                found.update(vectors(name, archive[name]))
            except ValueError:  # Python objects, which only running foreign code could restore
                continue
            except (zipfile.BadZipFile, OSError, EOFError) as error:
                raise InputError(f"{path}: '{name}' is damaged ({error})") from None
    return found


READER = Reader("NPZ", (".npz",), read_npz)
