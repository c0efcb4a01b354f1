"""A file appears whole or not at all: written beside, flushed, and moved when complete."""

from __future__ import annotations

import os
import re
import shutil
import socket
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

# Files that appear in the folders of reports and batches, each with what stands in it.
_MARKS = {
    "report.html": b"bayeshaptic",
    "summary.json": b'"critical_stiffness"',
    "population.json": b'"device_limit"',
    "limits.json": b'"bayeshaptic limits',
    "limits.csv": b"damping_filter,cutoff_hz,smoothing,",
    "index.html": b"bayeshaptic",
    "index.csv": b"name,device,user,configuration,status,",
    "failed.csv": b"name,folder,error",
}
_DRAFT = re.compile(
    r"\.(?:report|part)-(?P<host>[\w-]*)-(?P<pid>\d+)-[0-9a-f]{12}(?:-.*)?", re.DOTALL
)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """A hidden file beside `path` to write, which takes that name at the end of the block.

    Until then, and after an error, there is what was there before. What processes of this machine
    left beside it when they died is removed.
    """
    remove_dead_drafts(path.absolute().parent)
    end = 20  # of a name: long enough for its ending, by which some libraries know what to write
    partial = path.with_name(f".part-{owner()}-{path.name[-end:]}")
    try:
        with known_as(path, partial):
            yield partial
            flush(partial)
            os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


@contextmanager
def known_as(path: Path, hidden: Path) -> Iterator[None]:
    """What the system cannot do with a hidden file or folder is told of the name it is to have."""
    try:
        yield
    except OSError as error:
        for name in ("filename", "filename2"):
            told = getattr(error, name, None)
            if told is not None and Path(os.fsdecode(told)).is_relative_to(hidden):
                known = path / Path(os.fsdecode(told)).relative_to(hidden)
                setattr(error, name, str(known))
        raise


def write_whole(path: Path, text: str) -> None:
    """Write a text file; it is complete, or what was there before."""
    with whole_file(path) as partial:
        write_text(partial, text)


def write_text(path: Path, text: str) -> None:
    """Write UTF-8, the same on every system.

    A byte of a file's name that is no UTF-8, which Python holds as half of a pair of surrogates,
    is written as ``\\udce9``: in JSON that is what it stands for, and is read back as it.
    """
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def is_of_a_report(path: Path) -> bool | None:
    """Whether a file has the name and the content of one that reports and batches write.

    None where the name is no such, or, as of a picture, the content need not be looked at.
    """
    if path.name not in _MARKS or not path.is_file():
        return None
    most = 1_000_000  # bytes, in which a file says what it is
    with path.open("rb") as file:
        return _MARKS[path.name] in file.read(most)


def resolved(path: str | Path) -> Path:
    """Where a path leads, links followed; of links in a circle one of them.

    `Path.resolve` has an error of its own for these, which is no OSError, until Python 3.13.
    """
    return Path(os.path.realpath(path))


@contextmanager
def by_one_alone(folder: Path) -> Iterator[None]:
    """A block that others of this function wait for, while it changes the files of `folder`.

    The system ends the lock with its process.  Where it has none for folders (Windows, some
    network drives), nobody waits.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    place = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            fcntl.flock(place, fcntl.LOCK_EX)
        yield
    finally:
        os.close(place)


@contextmanager
def locked_file(path: Path) -> Iterator[bool]:
    """A block with a file that is locked, and goes with it; false where another has the lock.

    The system ends the lock with its process, and the file that one left that died is taken over.
    Where it has no locks (Windows, some network drives), everybody has one.
    """
    try:
        import fcntl
    except ImportError:
        yield True
        return
    while True:
        place = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(place, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(place)
            yield False
            return
        except OSError:
            break
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(place), os.stat(path)):
                break
        os.close(place)  # who had the lock has removed the file since
    try:
        yield True
    finally:
        path.unlink(missing_ok=True)
        os.close(place)


def flush(path: Path) -> None:
    """See to it that the content of a file is on the disk."""
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def remove_dead_drafts(folder: Path) -> None:
    """Remove what processes of this machine were writing in `folder` when they died."""
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        match = _DRAFT.fullmatch(path.name)
        if match and match["host"] == host() and not is_alive(int(match["pid"])):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


def owner() -> str:
    """A part of a draft's name, by which others know whether its process is alive."""
    return f"{host()}-{os.getpid()}-{uuid.uuid4().hex[:12]}"


def host() -> str:
    """Where processes have the numbers that they have here, as drafts name it.

    The machine's name alone does not say it: containers may have that of their machine, and each
    counts its processes by itself.
    """
    name = re.sub(r"[^\w]", "_", socket.gethostname())
    try:
        return f"{name}-{os.stat('/proc/self/ns/pid').st_ino}"
    except OSError:  # no Linux
        return name


def is_alive(pid: int) -> bool:
    """Whether this machine has such a process."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's; on Windows, where a signal 0 is none, do not ask
        return True
    return True
