"""HDF5 files, and the MAT files of version 7.3, which are HDF5."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.reader import Arrays, Reader, is_signal, refuse_size
from bayeshaptic.recordings.readers.tree import LONGEST_LIST, named_vectors


def read_hdf5(path: Path, separator: str = "/") -> Arrays:
    """The vectors of an HDF5 file, named by their paths (``group/force``).

    Links that lead nowhere are passed over; so are those that lead out of the file, and data sets
    kept elsewhere: a file says nothing about others. An attribute ``units`` stands in brackets
    after the name. The fields of a compound data set are vectors of their own.

    Raises
    ------
    InputError
        For a file that is not HDF5, or claims more than can be read.
    """
    import h5py

    # h5py meets damaged files with whatever exception its library runs into.
    try:
        with h5py.File(path, "r") as file:
            return named_vectors(_members(file), lambda node: _expand(node, path), separator)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{path}: not a readable HDF5 file ({error})") from None


def _members(group: Any) -> dict[str, Any]:
    """What a group holds, without links that are broken or lead out of the file."""
    import h5py

    found = {}
    for name in group:
        # MATLAB keeps its objects and the content of cells in #refs# and #subsystem#.
        if name.startswith("#"):
            continue
        try:
            if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
                continue
            node = group[name]
        except (KeyError, OSError, RuntimeError):
            continue
        found[f"{name}{_unit(node)}"] = node
    return found


def _unit(node: Any) -> str:
    import h5py

    if not isinstance(node, h5py.Dataset):
        return ""
    for key in ("units", "unit"):
        if key in node.attrs:
            unit = node.attrs[key]
            unit = unit.decode("utf-8", "replace") if isinstance(unit, bytes) else unit
            return f" ({unit})" if isinstance(unit, str) and unit.strip() else ""
    return ""


def _expand(node: Any, path: Path) -> Any:
    import h5py

    if isinstance(node, h5py.Group):
        return _structures(_members(node))
    if isinstance(node, dict | np.ndarray):
        return node
    if not isinstance(node, h5py.Dataset) or "MATLAB_empty" in node.attrs:
        return None
    if h5py.check_ref_dtype(node.dtype) is h5py.Reference:
        return list(_referenced(node))
    # MATLAB stores text as whole numbers.
    if node.attrs.get("MATLAB_class") == b"char":
        return _text(node)
    if node.is_virtual or node.external or not is_signal(node.shape or ()):
        return None
    fields = node.dtype.names or ()
    if node.dtype.kind not in "iufb" and not fields:
        return None
    refuse_size((*node.shape, max(len(fields), 1)), f"{path}: '{node.name}'")
    content = np.asarray(node[()])
    return {field: content[field] for field in fields} if fields else content


def _structures(members: dict[str, Any]) -> Any:
    """A structure; or a list of them, where every field is a row of references to its values."""
    import h5py

    def is_row(node: Any) -> bool:
        return (
            isinstance(node, h5py.Dataset)
            and h5py.check_ref_dtype(node.dtype) is h5py.Reference
            and node.attrs.get("MATLAB_class") is None
        )

    if not members or not all(is_row(node) for node in members.values()):
        return members
    if len({node.size for node in members.values()}) > 1:
        return members
    columns = [list(_referenced(node)) for node in members.values()]
    return [dict(zip(members, row, strict=True)) for row in zip(*columns, strict=True)]


def _referenced(node: Any) -> Iterator[Any]:
    """What the references of a data set point to; None where that is nothing."""
    if node.size > LONGEST_LIST:
        return
    for reference in np.asarray(node[()]).ravel(order="F"):
        try:
            yield node.file[reference] if reference else None
        except (KeyError, OSError, RuntimeError, ValueError):
            yield None


def _text(node: Any) -> str | None:
    if node.size > 1000 or node.dtype.kind not in "iu":
        return None
    return "".join(chr(int(code)) for code in np.asarray(node[()]).ravel() if 0 < code < 0xD800)


READER = Reader("HDF5", (".h5", ".hdf5", ".hdf"), read_hdf5, apart=True)
