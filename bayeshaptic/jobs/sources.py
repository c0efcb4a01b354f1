"""What a batch is about: studies and recordings, named or found in folders."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from bayeshaptic.devices.table import read_toml
from bayeshaptic.errors import InputError
from bayeshaptic.files import is_of_a_report, resolved
from bayeshaptic.recordings.readers import known_suffixes

# Text files that programs leave beside recordings.
_NO_RECORDINGS = ("readme.txt", "requirements.txt")
_REPORTS = ("summary.json", "population.json", "manifest.json")


def find_sources(paths: Iterable[Path]) -> tuple[Path, ...]:
    """Studies and recordings, folders replaced by those in them.

    A recording that a study of the same folder names is left to the study. Hidden folders, those
    with reports, and what reports and batches write are passed over; of a folder that is named, its
    content counts whatever else is in it.

    Raises
    ------
    InputError
        For a folder with neither studies nor recordings.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if not path.is_dir():
            found[path] = None
            continue
        inside = tuple(_in_folder(path, named=True))
        if not inside:
            raise InputError(f"{path}: no studies and no recordings in this folder")
        found |= dict.fromkeys(inside)
    return tuple(found)


def _in_folder(folder: Path, named: bool = False) -> Iterator[Path]:
    if not named and any((folder / name).exists() for name in _REPORTS):
        return
    content = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    tables = {path: _files_of(path) for path in content if path.suffix.lower() == ".toml"}
    studies = {path: files for path, files in tables.items() if files}
    yield from studies
    of_studies = {file for files in studies.values() for file in files}
    for path in content:
        if path.is_dir():
            yield from (file for file in _in_folder(path) if resolved(file) not in of_studies)
        elif (
            path.name.lower().endswith(known_suffixes())
            and path.name.lower() not in _NO_RECORDINGS
            and is_of_a_report(path) is not True
            and resolved(path) not in of_studies
        ):
            yield path


def _files_of(path: Path) -> tuple[Path, ...]:
    """The recordings that a TOML file names; none where it is no study."""
    try:
        entries = read_toml(path).get("recording")
    except InputError:
        return (path,)  # to be reported as a study that cannot be read
    if not isinstance(entries, list):
        return ()
    files = [entry.get("file") for entry in entries if isinstance(entry, dict)]
    return (path, *(resolved(path.parent / file) for file in files if isinstance(file, str)))
