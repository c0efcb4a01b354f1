"""Where a report comes from: command, options, versions, seed, inputs, and the time it took."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from bayeshaptic.version import __version__

_LIBRARIES = ("numpy", "scipy", "numba", "emcee", "arviz")


def provenance(
    command: str | None = None,
    options: Mapping[str, Any] | None = None,
    seed: int | None = None,
    source: Path | None = None,
    seconds: Mapping[str, float] | None = None,
) -> dict[str, Any]:
    """The content of `provenance` in `summary.json`; what is not known is null.

    Parameters
    ----------
    command : str or None
        The command line.
    options : mapping or None
        What was asked for, defaults included.
    seed : int or None
    source : Path or None
        The file, for its name and SHA-256.
    seconds : mapping of str to float, or None
        What each stage took.
    """
    return {
        "command": command,
        "options": None if options is None else dict(options),
        "versions": versions(),
        "seed": seed,
        "file": None if source is None else source.as_posix(),
        "sha256": None if source is None else sha256(source),
        "seconds": None if seconds is None else dict(seconds),
    }


def versions() -> dict[str, str]:
    """Of this package, of Python, and of the libraries that numbers depend on."""
    return dict(_versions())


@cache  # a batch asks for each of its recordings
def _versions() -> dict[str, str]:
    found = {"bayeshaptic": __version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def sha256(path: Path) -> str | None:
    """Of a file's content; None where it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None
