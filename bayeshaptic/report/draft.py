"""A folder's files appear whole or not at all: written beside, flushed, and moved when complete."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bayeshaptic.errors import InputError
from bayeshaptic.files import (
    by_one_alone,
    flush,
    is_of_a_report,
    known_as,
    locked_file,
    owner,
    remove_dead_drafts,
    resolved,
)


@contextmanager
def draft_in(folder: Path) -> Iterator[Path]:
    """A hidden folder in `folder` to write into, removed at the end; move what is complete.

    Drafts that processes of this machine left when they died are removed first.
    """
    remove_dead_drafts(folder)
    draft = folder / f".report-{owner()}"
    draft.mkdir(parents=True)
    try:
        yield draft
    finally:
        shutil.rmtree(draft, ignore_errors=True)


@contextmanager
def for_one_run(folder: Path) -> Iterator[None]:
    """A block that fills `folder` with several reports, and that no other process enters for it.

    What two of them write would be a mixture of both: a study's page with links to the recordings
    of another.  The folder is made, and goes again where nothing came of it.  The system ends the
    lock with its process; where it has none (Windows, some network drives), nobody is refused.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    InputError
        Where another process is in such a block.
    """
    new = [path for path in (folder, *folder.absolute().parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with locked_file(folder / ".in-use") as alone:
            if not alone:
                raise InputError(
                    f"{folder}: another run of bayeshaptic is writing there; wait until it has "
                    "ended, or name another folder with -o"
                )
            yield
    finally:
        with suppress(OSError):  # not empty
            for path in new:
                path.rmdir()


def refuse_to_replace(folder: Path, names: Iterable[str], sources: Iterable[str | Path]) -> None:
    """Refuse to write over what is read, and over what no report has written.

    Parameters
    ----------
    folder : Path
    names : iterable of str
        Of the files that are to be written there, or removed.
    sources : iterable of path
        Files that the report is made from.

    Raises
    ------
    InputError
        With the file, and what to do.
    """
    read = {resolved(source) for source in sources}
    for name in sorted(names):
        path = folder / name
        if resolved(path) in read:
            raise InputError(
                f"{path}: the report has a file of this name, which would replace the recording; "
                "rename the recording, or name another folder for the report"
            )
        if is_of_a_report(path) is False:
            raise InputError(
                f"{path}: the report has a file of this name, and this one is of no report; move "
                "it, or name another folder for the report"
            )


@contextmanager
def report_in(
    out_dir: str | Path, last: str, stale: Iterable[str], sources: Iterable[str | Path] = ()
) -> Iterator[Path]:
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
    sources : iterable of path
        Files that the report is made from, which it must not replace.

    Raises
    ------
    InputError
        If `out_dir` is a file, has no name, or holds files that a report must not replace.
    """
    if not str(out_dir).strip():
        raise InputError("the report's folder has an empty name; give one")
    stale = tuple(stale)
    out = resolved(out_dir)
    if out.exists() and not out.is_dir():
        raise InputError(f"{out_dir}: is a file; name a folder for the report.")
    with draft_in(out if out.exists() else out.parent) as draft, known_as(out, draft):
        yield draft
        move_all(draft, out, last, stale, sources)


def move_all(
    draft: Path,
    folder: Path,
    last: str,
    stale: Iterable[str] = (),
    sources: Iterable[str | Path] = (),
) -> None:
    """Move every file of a draft into `folder`, on the disk before it has its name.

    A new folder appears at once; in an older one `last` is missing while the files change. Two
    processes that report there at the same time do so one after the other: what is there then is
    one report.

    Parameters
    ----------
    draft, folder : Path
    last : str
        The file that others wait for.
    stale, sources
        See `report_in`.
    """
    files = sorted(draft.iterdir(), key=lambda path: path.name == last)
    for path in files:
        flush(path)
    if not folder.exists():
        # Somebody else's may have appeared since: files are in it, and nothing takes its place.
        with suppress(OSError):
            draft.rename(folder)
            return
    names = {path.name for path in files}
    with by_one_alone(folder):
        refuse_to_replace(folder, {*stale, *names}, sources)
        (folder / last).unlink(missing_ok=True)
        for name in set(stale) - names:
            (folder / name).unlink(missing_ok=True)
        for path in files:
            os.replace(path, folder / path.name)
