"""HDF5 files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.reader import Arrays, Reader, nested


def read_hdf5(path: Path, separator: str = "/") -> Arrays:
    """The vectors of an HDF5 file, named by their paths (``group/force``).

    Raises
    ------
    InputError
        For a file that is not HDF5.
    """
    import h5py

    def expand(node: Any) -> Any:
        if isinstance(node, Mapping):
            # MATLAB keeps its objects and the content of cells in #refs# and #subsystem#.
            return {name: node[name] for name in node if not name.startswith("#")}
        if not isinstance(node, h5py.Dataset) or node.dtype.kind not in "iufb":
            return None
        # MATLAB stores text and the sizes of empty variables as whole numbers.
        if "MATLAB_empty" in node.attrs or node.attrs.get("MATLAB_class") == b"char":
            return None
        return np.asarray(node[()])

    try:
        with h5py.File(path, "r") as file:
            return nested(expand(file), expand, separator)
    except (OSError, RuntimeError, KeyError) as error:
        raise InputError(f"{path}: not a readable HDF5 file ({error})") from None


READER = Reader("HDF5", (".h5", ".hdf5", ".hdf"), read_hdf5)
