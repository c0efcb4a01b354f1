"""From files to reports: one recording, one study, or many of either.

`report_source` is the job that the commands ``report`` and ``batch`` run, and that an executor can
carry to another process: it is called with plain picklable things, and hands back plain things.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from bayeshaptic.errors import InputError
from bayeshaptic.jobs.job import Job, Settings, refuse_file
from bayeshaptic.jobs.recording import report_recording
from bayeshaptic.jobs.study import report_study
from bayeshaptic.recordings.read import recording_name
from bayeshaptic.report.reported import Reported
from bayeshaptic.types import Progress


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
    refuse_file(job.folder)
    if job.source.suffix.lower() == ".toml":
        return report_study(job, progress, workers)
    return (report_recording(job, progress),)


def jobs(sources: Iterable[Path], parent: Path, settings: Settings) -> tuple[Job, ...]:
    """A job for each source, each with a folder of its own in `parent`.

    Parameters
    ----------
    sources : iterable of Path
    parent : Path
    settings : Settings

    Raises
    ------
    InputError
        Where two sources have the same name.
    """
    by_name: dict[str, Job] = {}
    for source in sources:
        name = recording_name(source)
        if name in by_name:
            raise InputError(
                f"{by_name[name].source} and {source} would both be reported in {parent / name}; "
                "rename one, or run them apart"
            )
        by_name[name] = Job(source, parent / name, settings)
    return tuple(by_name.values())
