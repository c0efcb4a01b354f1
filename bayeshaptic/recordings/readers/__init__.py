"""Readers of recordings: one file a format, and the registry that finds them by file name."""

from __future__ import annotations

from pathlib import Path

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers import delimited, hdf5, matlab, npz
from bayeshaptic.recordings.readers.reader import Arrays, Reader

_registry: list[Reader] = [delimited.READER, matlab.READER, hdf5.READER, npz.READER]

__all__ = ["Arrays", "Reader", "read_arrays", "reader_for", "register_reader"]


def register_reader(reader: Reader) -> None:
    """Add a file format; it comes before those that are there, so that it can replace one."""
    _registry.insert(0, reader)


def reader_for(path: Path) -> Reader:
    """The reader whose suffix ends the file's name.

    Raises
    ------
    InputError
        Where no reader knows the suffix.
    """
    for reader in _registry:
        if path.name.lower().endswith(reader.suffixes):
            return reader
    known = " ".join(suffix for reader in _registry for suffix in reader.suffixes)
    raise InputError(
        f"{path}: no reader for files ending in '{path.suffix}'; known endings: {known}"
    )


def read_arrays(path: Path) -> Arrays:
    """The named 1-D arrays of a file, whatever its format.

    Raises
    ------
    InputError
        Where the file is missing, of an unknown format, unreadable, or holds no arrays.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(f"{path}: a folder; name a recording in it, or a study (.toml)")
    reader = reader_for(path)
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    arrays = reader.read(path)
    if not arrays:
        raise InputError(f"{path}: no vectors of numbers in this {reader.title} file")
    return arrays
