"""A folder's files appear whole or not at all: written beside, flushed, and moved when complete."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from bayeshaptic.errors import InputError
from bayeshaptic.files import flush, owner, remove_dead_drafts


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
        flush(path)
    if not folder.exists():
        draft.rename(folder)
        return
    (folder / last).unlink(missing_ok=True)
    for path in files:
        os.replace(path, folder / path.name)
