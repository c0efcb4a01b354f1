"""How to make a report again: command, options, versions, seed, hashes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.provenance import sha256, versions

if TYPE_CHECKING:
    from bayeshaptic.report.numbers.rows import Rows


def reproduce(result: Result, origin: Mapping[str, Any] | None) -> Rows:
    """(what, value): the command, the file and its hash, the seed, the time of stages, versions.

    Parameters
    ----------
    result : Analysis or Closed
    origin : mapping, optional
        What `bayeshaptic.provenance` gives; a result that was made from Python has none.
    """
    told = origin or {}
    rows: list[tuple[str, ...]] = []
    if told.get("command"):
        rows.append(("Command", str(told["command"])))
    recording = result.measured.recording
    source = None if recording is None else recording.source
    file = told.get("file") or (None if source is None else source.as_posix())
    if file is not None:
        rows.append(("File", str(file)))
        digest = told.get("sha256") or sha256(Path(file))
        if digest:
            rows.append(("SHA-256", str(digest)))
    rows.append(("Seed", str(result.analysis.posterior.seed)))
    stages = result.analysis.seconds
    if stages:
        rows.append(("Time taken", ", ".join(f"{name} {t:.1f} s" for name, t in stages.items())))
    return (*rows, *versions().items())


def asked(origin: Mapping[str, Any] | None = None) -> Rows:
    """(option, value): everything that was asked for, defaults included."""
    options = (origin or {}).get("options") or {}
    return tuple((name, _written(value)) for name, value in options.items())


def _written(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value) if value or value == 0 else "not given"
