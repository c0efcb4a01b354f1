"""MAT files: version 5 (and 4) through scipy, version 7.3 as the HDF5 file that it is."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.hdf5 import read_hdf5
from bayeshaptic.recordings.readers.reader import Arrays, Reader, nested

_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def read_matlab(path: Path) -> Arrays:
    """The vectors of a MAT file of any version; fields of structures are named ``structure.field``.

    MATLAB objects, cells, text and empty variables are passed over.

    Raises
    ------
    InputError
        For a file that is not a MAT file.
    """
    try:
        with path.open("rb") as file:
            start = file.read(520)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if _HDF5_SIGNATURE in (start[:8], start[512:520]):
        return read_hdf5(path, separator=".")
    return nested(_variables(path), _expand)


def _variables(path: Path) -> dict[str, Any]:
    """The variables of a version 5 file, one by one where an object in it defeats the reader."""
    from scipy.io import loadmat, whosmat

    def load(names: list[str] | None) -> dict[str, Any]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            content = loadmat(path, variable_names=names)
        # An object without a name comes as the key None.
        return {k: v for k, v in content.items() if isinstance(k, str) and not k.startswith("__")}

    # scipy meets damaged or exotic files with whatever exception its parser runs into.
    try:
        return load(None)
    except Exception as error:
        try:
            names = [name for name, *_ in whosmat(path)]
        except Exception:
            raise InputError(f"{path}: not a readable MAT file ({error})") from None
    found: dict[str, Any] = {}
    for name in names:
        try:
            found.update(load([name]))
        except Exception:
            continue
    return found


def _expand(node: Any) -> Any:
    if not isinstance(node, np.ndarray):
        return None
    if node.dtype.names is not None:
        # A structure; an array of structures has no one vector a field.
        if node.size != 1 or type(node) is not np.ndarray:
            return None
        return {name: node[name].flat[0] for name in node.dtype.names}
    return node


READER = Reader("MAT", (".mat",), read_matlab)
