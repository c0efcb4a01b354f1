"""Readers of recordings: one file a format, and the registry that finds them by file name."""

from __future__ import annotations

import sys
from pathlib import Path

from bayeshaptic.errors import InputError, refuse_no_path
from bayeshaptic.recordings.readers import delimited, hdf5, matlab, npz, spreadsheet, tdms
from bayeshaptic.recordings.readers.apart import read_apart, write_arrays
from bayeshaptic.recordings.readers.reader import Arrays, Reader

_BUILT_IN = tuple(module.READER for module in (delimited, matlab, hdf5, npz, tdms, spreadsheet))
_registry: list[Reader] = [*_BUILT_IN]

__all__ = [
    "Arrays",
    "Reader",
    "known_suffixes",
    "read_arrays",
    "read_here",
    "reader_for",
    "register_reader",
]


def register_reader(reader: Reader) -> None:
    """Add a file format; it comes before those that are there, so that it can replace one."""
    _registry.insert(0, reader)


def known_suffixes() -> tuple[str, ...]:
    """The ends of file names that some reader knows, in lower case."""
    return tuple(suffix for reader in _registry for suffix in reader.suffixes)


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
    raise InputError(
        f"{path}: no reader for files ending in '{path.suffix}'; known endings: "
        + " ".join(known_suffixes())
        + "; write its columns to one of these, a table as .csv"
    )


def read_arrays(path: Path) -> Arrays:
    """The named 1-D arrays of a file, whatever its format.

    Raises
    ------
    InputError
        Where the file is missing, of an unknown format, unreadable, or holds no arrays.
    """
    refuse_no_path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if path.is_dir():
        raise InputError(
            f"{path}: a folder; name a recording in it, or a study (.toml), or report on each of "
            "its recordings by 'bayeshaptic batch'"
        )
    reader = reader_for(path)
    if not path.is_file():
        raise InputError(f"{path}: not a file")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: the file is empty")
    arrays = read_apart(reader, path) if reader.apart and reader in _BUILT_IN else reader.read(path)
    if not arrays:
        raise InputError(f"{path}: no vectors of numbers in this {reader.title} file")
    return arrays


def read_here() -> None:
    """What `read_apart` runs: a reader's title, a file and seconds are on the command line."""
    title, path, seconds = sys.argv[1:]
    (reader,) = (one for one in _BUILT_IN if one.title == title)
    write_arrays(reader, Path(path), int(seconds))
