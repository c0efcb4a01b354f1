"""What a long computation has done so far, on the disk: an interrupted one goes on from there.

A checkpoint is arrays in NumPy's format behind the hash of them, in a file called by its key: the
hash of everything that the computation depends on.  One that is damaged, or was renamed, is passed
over with a warning; what goes on from one gives the numbers of a run that nobody interrupted.
"""

from __future__ import annotations

import hashlib
import io
import shutil
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import BayeshapticWarning, describe
from bayeshaptic.files import whole_file

EVERY_S = 10.0  # what is lost at most, beyond the step that runs; shorter runs write nothing
MOST_BYTES = 1 << 30

Stored = Mapping[str, NDArray[Any]]
T = TypeVar("T")


def key_of(*parts: Any) -> str:
    """The key of a computation: of arrays to the last digit, and of anything else as written."""
    found = hashlib.sha256()
    for part in parts:
        content = part.tobytes() if isinstance(part, np.ndarray) else str(part).encode()
        found.update(hashlib.sha256(content).digest())
    return found.hexdigest()


@dataclass
class Checkpoint:
    """Where one computation keeps its state.

    Attributes
    ----------
    folder : Path or None
        Made when there is something to keep; with None nothing is kept.
    key : str
        See `key_of`.
    """

    folder: Path | None
    key: str
    _written: float = field(default_factory=time.monotonic, init=False)

    @property
    def path(self) -> Path | None:
        return None if self.folder is None else self.folder / f"{self.key[:32]}.state"

    def read(self, restore: Callable[[Stored], T]) -> T | None:
        """What `restore` makes of what was kept; None where there is nothing that can be used."""
        if self.path is None or not self.path.is_file():
            return None
        try:
            return restore(_unpacked(self.path, self.key))
        # NumPy meets damaged files with whatever exception its parser runs into.
        except Exception as error:
            warnings.warn(
                f"{self.path}: not used ({describe(error)}); the sampler starts anew",
                BayeshapticWarning,
                stacklevel=2,
            )
            return None

    def due(self) -> bool:
        """Whether what was done since the last writing is worth another."""
        return self.folder is not None and time.monotonic() - self._written >= EVERY_S

    def write(self, arrays: Stored) -> None:
        """Keep a state in the place of the one before, whole; a full disk is a warning."""
        if self.folder is None or self.path is None:
            return
        content, named = io.BytesIO(), {**arrays, "key": np.array(self.key)}
        np.savez(content, **cast(Any, named))
        packed = content.getvalue()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with whole_file(self.path) as partial:
                partial.write_bytes(hashlib.sha256(packed).digest() + packed)
        except OSError as error:
            warnings.warn(
                f"no checkpoint could be written ({describe(error)}); an interrupted run would "
                "start anew",
                BayeshapticWarning,
                stacklevel=2,
            )
            self.folder = None
        self._written = time.monotonic()


@contextmanager
def kept_until_done(folder: Path) -> Iterator[Path]:
    """`folder` for checkpoints, removed when the block ends, but not where it is interrupted."""
    try:
        yield folder
    except Exception:  # it would fail again
        shutil.rmtree(folder, ignore_errors=True)
        raise
    shutil.rmtree(folder, ignore_errors=True)


def _unpacked(path: Path, key: str) -> Stored:
    if path.stat().st_size > MOST_BYTES:
        raise ValueError("too large")
    content = path.read_bytes()
    digest, packed = content[:32], content[32:]
    if hashlib.sha256(packed).digest() != digest:
        raise ValueError("damaged")
    with np.load(io.BytesIO(packed), allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}
    if str(arrays.pop("key")) != key:
        raise ValueError("of another computation")
    return arrays
