"""What a batch has done: `manifest.json`, by which the next run knows what is left."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from bayeshaptic.errors import InputError
from bayeshaptic.files import host, is_alive, write_whole
from bayeshaptic.jobs.job import Job
from bayeshaptic.provenance import sha256, versions
from bayeshaptic.recordings.study_file import read_study

NAME = "manifest.json"
FORMAT = "bayeshaptic batch 1"


@dataclass(frozen=True)
class ManifestEntry:
    """One source of a batch.

    Attributes
    ----------
    source, folder : str
    inputs : mapping of str to str
        SHA-256 of every file that was read, by its path.
    key : str
        Of inputs, options and versions: the same key gives the same report.
    state : {"waiting", "done", "failed"}
    error : str or None
    seconds : float or None
    rows : tuple of mapping
        Of the index: a recording each, and a study's device.
    """

    source: str
    folder: str
    inputs: Mapping[str, str | None]
    key: str
    state: str = "waiting"
    error: str | None = None
    seconds: float | None = None
    rows: tuple[Mapping[str, Any], ...] = field(default=())


def manifest_entry(job: Job) -> ManifestEntry:
    """The entry of a job that is still to be done."""
    files = [job.source]
    if job.source.suffix.lower() == ".toml":
        with contextlib.suppress(InputError):  # said when it is its turn
            files += read_study(job.source, job.settings.allow_outside).files
    device = job.settings.device
    if isinstance(device, str | Path) and Path(device).is_file():
        files.append(Path(device))
    inputs = {str(file): sha256(file) for file in files}
    about = [inputs, job.settings.facts(), versions()]
    key = hashlib.sha256(json.dumps(about, sort_keys=True).encode()).hexdigest()
    return ManifestEntry(str(job.source), str(job.folder), inputs, key)


def read_manifest(folder: Path) -> dict[str, ManifestEntry]:
    """Entries by source; none where there is no manifest, or one that cannot be understood."""
    try:
        content = json.loads((folder / NAME).read_text(encoding="utf-8"))
        entries = [
            ManifestEntry(**{**one, "rows": tuple(one["rows"])}) for one in content["entries"]
        ]
    except (OSError, ValueError, TypeError, KeyError):
        return {}
    return {entry.source: entry for entry in entries}


def has_ended(folder: Path) -> bool:
    """Whether the process that wrote the manifest was one of this machine, and lives no more."""
    try:
        content = json.loads((folder / NAME).read_text(encoding="utf-8"))
        return bool(content["host"] == host()) and not is_alive(int(content["pid"]))
    except (OSError, ValueError, TypeError, KeyError):
        return False


def write_manifest(
    folder: Path,
    entries: Mapping[str, ManifestEntry],
    command: str | None,
    options: Mapping[str, Any],
) -> None:
    """Write it whole."""
    content = {
        "format": FORMAT,
        "command": command,
        "options": dict(options),
        "versions": versions(),
        "host": host(),
        "pid": os.getpid(),
        "entries": [asdict(entry) for entry in entries.values()],
    }
    write_whole(folder / NAME, json.dumps(content, indent=1, ensure_ascii=False) + "\n")
