"""Readers in a process of their own: a library that crashes on a damaged file crashes alone.

The process may take a share of memory and of processor time, reads one file, and hands its arrays
back in NumPy's own format, which runs no code when it is read.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import IO

import numpy as np

from bayeshaptic.errors import InputError, one_line
from bayeshaptic.recordings.readers.reader import Arrays, Reader

MOST_BYTES = 2 << 30
# Processor time, and more for large files; the wall clock may run ten times as fast on a busy
# machine.
MOST_SECONDS = 10
BYTES_A_SECOND = 20_000_000

_REFUSED = 3
_COMMAND = "from bayeshaptic.recordings.readers import read_here; read_here()"


def read_apart(reader: Reader, path: Path) -> Arrays:
    """What ``reader.read(path)`` gives, by another process.

    Raises
    ------
    InputError
        As the reader does; and where it crashes, or takes too long or too much memory.
    """
    seconds = MOST_SECONDS + path.stat().st_size // BYTES_A_SECOND
    command = [sys.executable, "-c", _COMMAND, reader.title, str(path), str(seconds)]
    places = [str(Path(__file__).parents[3]), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(places),
        "OPENBLAS_NUM_THREADS": "1",
        "PYTHONIOENCODING": "utf-8",
        "HDF5_USE_FILE_LOCKING": "FALSE",
    }
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            env=environment,
            timeout=10 * seconds,
        )
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: reading it took more than {10 * seconds} s") from None
    if done.returncode == _REFUSED:
        # Not by stderr, where libraries say what they think of a file.
        raise InputError(one_line(done.stdout.decode("utf-8", "replace")))
    if done.returncode != 0:
        raise InputError(
            f"{path}: not a readable {reader.title} file: its reader gave up on it (damaged, or "
            "larger than can be read)"
        )
    return _unpacked(io.BytesIO(done.stdout))


def write_arrays(reader: Reader, path: Path, seconds: int) -> None:
    """In the process apart: read, and write the arrays to stdout; or the error there."""
    _limit(seconds)
    out, sys.stdout = sys.stdout.buffer, sys.stderr
    try:
        arrays = reader.read(path)
        names: dict[int, list[str]] = {}  # an array may have several
        for name, values in arrays.items():
            names.setdefault(id(values), []).append(name)
        out.write(json.dumps(list(names.values())).encode() + b"\n")
        # NumPy asks a file where it stands, which a pipe does not know: one that can only be
        # written to is not asked.
        pipe = SimpleNamespace(write=out.write)
        for same in names.values():
            values = np.ascontiguousarray(arrays[same[0]])
            np.lib.format.write_array(pipe, values, allow_pickle=False)  # type: ignore[arg-type]
        out.flush()
    except (InputError, MemoryError) as error:
        what = str(error) if isinstance(error, InputError) else f"{path}: too large to be read"
        out.write(what.encode("utf-8", "replace"))
        out.flush()
        os._exit(_REFUSED)
    # Libraries may crash while they tidy up.
    os._exit(0)


def _unpacked(content: IO[bytes]) -> Arrays:
    arrays: Arrays = {}
    for same in json.loads(content.readline()):
        arrays |= dict.fromkeys(same, np.lib.format.read_array(content, allow_pickle=False))
    return arrays


def _limit(seconds: int) -> None:
    """Bounds on memory and processor time, where the system has them."""
    try:
        import resource
    except ImportError:  # Windows
        return
    for kind, most in ((resource.RLIMIT_AS, MOST_BYTES), (resource.RLIMIT_CPU, seconds)):
        _, hard = resource.getrlimit(kind)
        if hard == resource.RLIM_INFINITY or most < hard:
            resource.setrlimit(kind, (most, hard))
    resource.setrlimit(resource.RLIMIT_CORE, (0, resource.getrlimit(resource.RLIMIT_CORE)[1]))
