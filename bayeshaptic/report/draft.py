"""A folder's files appear whole or not at all: written beside, flushed, and moved when complete."""

from __future__ import annotations

import os
import re
import shutil
import socket
import uuid
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bayeshaptic.errors import InputError

_DRAFT = re.compile(r"\.(?:report|.+\.part)-(?P<host>[\w-]*)-(?P<pid>\d+)-[0-9a-f]{12}")


@contextmanager
def draft_in(folder: Path) -> Iterator[Path]:
    """A hidden folder in `folder` to write into, removed at the end; move what is complete.

    Drafts that processes of this machine left when they died are removed first.
    """
    remove_dead_drafts(folder)
    draft = folder / f".report-{_owner()}"
    draft.mkdir(parents=True)
    try:
        yield draft
    finally:
        shutil.rmtree(draft, ignore_errors=True)


@contextmanager
def report_in(out_dir: str | Path, last: str, stale: Iterable[str]) -> Iterator[Path]:
    """A folder to write a report into; moved to `out_dir` when the block ends without an error.

    An interrupted run leaves what was there before. Other files in `out_dir` stay.

    Parameters
    ----------
    out_dir : str or Path
        Made where it is missing, with its parents.
    last : str
        The file that others wait for.
    stale : iterable of str
        Files of an older report that would contradict this one, unless this one has them too.

    Raises
    ------
    InputError
        If `out_dir` is a file.
    """
    out = Path(out_dir).resolve()
    if out.exists() and not out.is_dir():
        raise InputError(f"{out_dir}: is a file; name a folder for the report.")
    with draft_in(out if out.exists() else out.parent) as draft:
        yield draft
        for name in stale:
            if not (draft / name).exists():
                (out / name).unlink(missing_ok=True)
        move_all(draft, out, last)


def move_all(draft: Path, folder: Path, last: str) -> None:
    """Move every file of a draft into `folder`, on the disk before it has its name.

    A new folder appears at once; in an older one `last` is missing while the files change.

    Parameters
    ----------
    draft, folder : Path
    last : str
        The file that others wait for.
    """
    files = sorted(draft.iterdir(), key=lambda path: path.name == last)
    for path in files:
        with path.open("rb+") as file:
            os.fsync(file.fileno())
    if not folder.exists():
        draft.rename(folder)
        return
    (folder / last).unlink(missing_ok=True)
    for path in files:
        os.replace(path, folder / path.name)


def write_whole(path: Path, text: str) -> None:
    """Write a text file; it is complete, or what was there before."""
    partial = path.with_name(f".{path.name}.part-{_owner()}")
    try:
        with partial.open("w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)


def remove_dead_drafts(folder: Path) -> None:
    """Remove what processes of this machine were writing in `folder` when they died."""
    if not folder.is_dir():
        return
    for path in folder.iterdir():
        match = _DRAFT.fullmatch(path.name)
        if match and match["host"] == _host() and not _is_alive(int(match["pid"])):
            if path.is_dir():
                shutil.rmtree(path, ignore_errors=True)
            else:
                path.unlink(missing_ok=True)


def _owner() -> str:
    """The end of a draft's name, by which others know whether its process is alive."""
    return f"{_host()}-{os.getpid()}-{uuid.uuid4().hex[:12]}"


def _host() -> str:
    return re.sub(r"[^\w]", "_", socket.gethostname())


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:  # somebody else's; on Windows, where a signal 0 is none, do not ask
        return True
    return True
