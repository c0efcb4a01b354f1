"""From files to reports: one recording, one study, or many of either.

`report_source` is the job that the commands ``report`` and ``batch`` run, and that an executor can
carry to another process: it is called with plain picklable things, and hands back plain things.
"""

from __future__ import annotations

import concurrent.futures
import math
import multiprocessing
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.files import remove_dead_drafts, resolved
from bayeshaptic.jobs import executors
from bayeshaptic.jobs.executors import Outcome
from bayeshaptic.jobs.index import FILES as INDEX_FILES, row_of, write_index
from bayeshaptic.jobs.job import Job, Settings, refuse_file
from bayeshaptic.jobs.manifest import (
    NAME as MANIFEST,
    ManifestEntry,
    manifest_entry,
    read_manifest,
    write_manifest,
)
from bayeshaptic.jobs.sources import find_sources
from bayeshaptic.recordings.from_columns import recording_name
from bayeshaptic.report.draft import for_one_run, refuse_to_replace
from bayeshaptic.types import Executor, Progress

if TYPE_CHECKING:
    from bayeshaptic.report.reported import Reported

SECONDS_BETWEEN_WRITES = 2.0


def report_source(
    job: Job, progress: Progress | None = None, workers: int = 1
) -> tuple[Reported, ...]:
    """Report on a recording, a table of a frequency response, or a study.

    Of a study, every recording has a report in a folder of its own, and ``report.html`` is that of
    the device; a recording that fails is listed with its error and does not stop the others.

    Parameters
    ----------
    job : Job
    progress : callable, optional
        Called with the share done and a word about it.
    workers : int
        Processes for the recordings of a study.

    Returns
    -------
    tuple of Reported
        Of a study the device's report is the last.

    Raises
    ------
    InputError
        Where the source or the settings cannot be used.
    """
    # Where many jobs are only handed out, what does them is not loaded.
    refuse_file(job.folder)
    if job.source.suffix.lower() == ".toml":
        from bayeshaptic.jobs.study import report_study

        return report_study(job, progress, workers)
    from bayeshaptic.jobs.recording import report_recording

    return (report_recording(job, progress),)


def jobs(
    sources: Iterable[Path], parent: Path, settings: Settings, command: str | None = None
) -> tuple[Job, ...]:
    """A job for each source, each with a folder of its own in `parent`.

    Of sources with the same name it stands where the source stands among all of them.

    Parameters
    ----------
    sources : iterable of Path
        Studies, recordings, and folders with such.
    parent : Path
    settings : Settings
    command : str or None

    Raises
    ------
    InputError
        Where two sources of one folder have the same name, or a folder has none.
    """
    found = find_sources(sources)
    names = Counter(map(recording_name, found))
    root = os.path.commonpath([source.parent for source in found]) if found else ""
    by_folder: dict[Path, Job] = {}
    for source in found:
        name = recording_name(source)
        place = parent / source.parent.relative_to(root) if names[name] > 1 else parent
        job = Job(source, place / name, settings, command)
        other = by_folder.setdefault(job.folder, job)
        if other is not job:
            raise InputError(
                f"{other.source} and {source} would both be reported in {job.folder}; "
                "rename one, or run them apart"
            )
    return tuple(by_folder.values())


@at_the_door
def run_batch(
    sources: Iterable[str | Path],
    out_dir: str | Path,
    settings: Settings | None = None,
    executor: concurrent.futures.Executor | Executor | None = None,
    resume: bool = True,
    command: str | None = None,
    tell: Callable[[ManifestEntry, tuple[Reported, ...], int, int], None] | None = None,
) -> tuple[ManifestEntry, ...]:
    """Report on many sources, and write an index of them.

    Every source has a folder in `out_dir`; beside them are ``index.html``, ``index.csv``,
    ``failed.csv`` where something failed, and ``manifest.json``. One that fails does not stop the
    others, and is tried once more at the end, alone, unless its input was refused.

    Parameters
    ----------
    sources : iterable of path
        Studies, recordings, and folders with such.
    out_dir : path
    settings : Settings or None
        How to read and analyse.
    executor : concurrent.futures.Executor, callable or None
        Where the work is done: any pool (processes, dask, mpi4py), or one of
        `bayeshaptic.jobs.executors`; None takes a process for each usable core.
    resume : bool
        Whether to leave alone what an earlier run has done from the same files, with the same
        options and versions.
    command : str or None
        For the manifest.
    tell : callable or None
        Called with the entry, its reports (none where it was done before), the number that are
        done, and how many there are.

    Returns
    -------
    tuple of ManifestEntry
        In the order of the sources.

    Raises
    ------
    InputError
        Where there is nothing to do, or no place to write, or a recording would be written over, or
        where another run writes there.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        # A worker that this very call is starting: it must end, and nobody catches anything there.
        raise SystemExit(
            "bayeshaptic: error: run_batch starts processes, which read this script anew: put the "
            "call under if __name__ == '__main__':"
        )
    folder = Path(out_dir).absolute()
    refuse_file(folder)
    settings = settings or Settings()
    work = jobs([Path(source).absolute() for source in sources], folder, settings, command)
    refuse_to_replace(folder, (*INDEX_FILES, MANIFEST), [job.source for job in work])
    with for_one_run(folder):
        for place in (folder, *(job.folder for job in work)):
            remove_dead_drafts(place)
        batch = _Batch(folder, settings, command, tell, {str(job.source): job for job in work})
        old = read_manifest(folder) if resume else {}
        todo = [job for job in work if not batch.is_done(old.get(str(job.source)), job)]
        try:
            batch.write()  # for whoever asks how far it is
            _report_each(todo, _executor(executor), batch)
        finally:
            batch.write()
        return tuple(batch.entries.values())


def _report_each(todo: Sequence[Job], execute: Executor, batch: _Batch) -> None:
    """Every job once; those that failed, unless they were refused, once more by themselves."""
    again: list[Job] = []
    for outcome in execute(report_timed, todo) if todo else ():
        if outcome.error is None or outcome.refused:
            batch.end(outcome)
        else:
            again.append(outcome.item)
    for job in again:
        for outcome in execute(report_timed, [job]):
            batch.end(outcome)


def report_timed(job: Job) -> tuple[tuple[Reported, ...], float]:
    """What `run_batch` runs, in whatever process: the reports, and the seconds they took."""
    began = time.perf_counter()
    return report_source(job), time.perf_counter() - began


class _Batch:
    """The state of a batch, written to its folder every few seconds."""

    def __init__(
        self,
        folder: Path,
        settings: Settings,
        command: str | None,
        tell: Callable[[ManifestEntry, tuple[Reported, ...], int, int], None] | None,
        work: Mapping[str, Job],
    ) -> None:
        self.folder, self.settings, self.command, self.tell = folder, settings, command, tell
        self.entries = {source: manifest_entry(job) for source, job in work.items()}
        self._written = -math.inf

    def is_done(self, old: ManifestEntry | None, job: Job) -> bool:
        """Whether an earlier run has done the same; its entry is kept then."""
        entry = self.entries[str(job.source)]
        whole = any((job.folder / name).exists() for name in ("summary.json", "population.json"))
        if old is None or old.state != "done" or old.key != entry.key or not whole:
            return False
        self._keep(old, ())
        return True

    def end(self, outcome: Outcome) -> None:
        """Note how a job ended."""
        job = outcome.item
        reports, seconds = outcome.result or ((), None)
        failures = [one.error for one in reports if one.error is not None]
        error = outcome.error or (failures[0] if failures else None)
        where = job.folder.relative_to(self.folder).parent
        rows = [
            row_of(
                (where / _within(one, job) / one.name).as_posix(),
                job.folder if one.page is None else one.page.parent,
                one.headline.status if one.headline else None,
                one.error,
            )
            for one in reports
        ]
        if outcome.error is not None:
            name = (where / recording_name(job.source)).as_posix()
            rows = [row_of(name, job.folder, None, outcome.error)]
        entry = replace(
            self.entries[str(job.source)],
            state="done" if error is None else "failed",
            error=error,
            seconds=seconds,
            rows=tuple(rows),
        )
        self._keep(entry, reports)

    def _keep(self, entry: ManifestEntry, reports: tuple[Reported, ...]) -> None:
        self.entries[entry.source] = entry
        if self.tell is not None:
            ended = sum(one.state != "waiting" for one in self.entries.values())
            self.tell(entry, reports, ended, len(self.entries))
        if time.monotonic() - self._written > SECONDS_BETWEEN_WRITES:
            self.write()

    def write(self) -> None:
        """Manifest and index."""
        write_manifest(self.folder, self.entries, self.command, self.settings.facts())
        write_index(self.folder, [row for entry in self.entries.values() for row in entry.rows])
        self._written = time.monotonic()


def _within(one: Reported, job: Job) -> str:
    """Where a report stands in its source: in the study, where it is of one of its recordings."""
    of_source = one.page is not None and resolved(one.page.parent) == resolved(job.folder)
    return "" if of_source else job.folder.name


def _executor(executor: concurrent.futures.Executor | Executor | None) -> Executor:
    if executor is None:
        return executors.processes(executors.usable_cores())
    if isinstance(executor, concurrent.futures.Executor):
        return executors.futures(executor)
    return executor
