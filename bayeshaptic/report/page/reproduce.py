"""How to make a report again: command, options, versions, seed, hashes."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.provenance import sha256, versions

if TYPE_CHECKING:
    from bayeshaptic.report.numbers.rows import Rows


def reproduce(result: Result) -> Rows:
    """(what, value): the command, the file and its hash, the seed, versions, the time of stages.

    What the command line knows of itself comes with the result as `provenance`; a result that was
    made from Python has none.
    """
    given = getattr(result, "provenance", None) or getattr(result.analysis, "provenance", None)
    told: Mapping[str, Any] = given if isinstance(given, Mapping) else {}
    rows: list[tuple[str, ...]] = []
    command = told.get("command")
    if command:
        words = command if isinstance(command, str) else shlex.join(map(str, command))
        rows.append(("Command", words))
    rows += [(f"Option {name}", str(value)) for name, value in (told.get("options") or {}).items()]
    rows += _file(result, told.get("sha256"))
    rows.append(("Seed", str(result.analysis.posterior.seed)))
    seconds = result.analysis.seconds
    took = ", ".join(f"{name} {spent:.1f} s" for name, spent in seconds.items())
    if took:
        rows.append(("Time taken", took))
    return (*rows, *versions().items())


def _file(result: Result, known: Any) -> list[tuple[str, ...]]:
    recording = result.measured.recording
    source = None if recording is None else recording.source
    if source is None:
        return []
    rows: list[tuple[str, ...]] = [("File", source.as_posix())]
    digest = known if isinstance(known, str) else sha256(source)
    if digest:
        rows.append(("SHA-256", digest))
    return rows
