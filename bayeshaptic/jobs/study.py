"""From the recordings of a study to the report of its device."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from bayeshaptic.errors import InputError
from bayeshaptic.faq import explained
from bayeshaptic.inference.saved.checkpoint import kept_until_done
from bayeshaptic.jobs import executors
from bayeshaptic.jobs.executors import Outcome
from bayeshaptic.jobs.job import Job, checkpoints_of, refuse_file
from bayeshaptic.jobs.recording import reported
from bayeshaptic.provenance import provenance
from bayeshaptic.recordings.study import Study
from bayeshaptic.recordings.study_file import read_study
from bayeshaptic.report.draft import for_one_run, refuse_to_replace
from bayeshaptic.report.reported import Reported
from bayeshaptic.report.study.headline import study_headline
from bayeshaptic.report.study.write import NAMES, write_study_report
from bayeshaptic.report.write import NAMES as OF_A_RECORDING
from bayeshaptic.study.analysed import names_of
from bayeshaptic.study.analysis import StudyAnalysis, analyse_study
from bayeshaptic.types import Executor, Progress

_WRITING = 0.95


def report_study(job: Job, progress: Progress | None, workers: int) -> tuple[Reported, ...]:
    """The report of every recording, then that of the device.

    Parameters
    ----------
    job : Job
        Whose source is a study.
    progress : callable or None
    workers : int
        Processes for the recordings.

    Returns
    -------
    tuple of Reported
        Of the recordings in their order, and of the device where any of them could be used.

    Raises
    ------
    InputError
        Where the study or the settings cannot be used.
    """
    study = _read(job)
    pages: dict[int, Reported] = {}

    def executor(analyse: Callable[..., Any], tasks: Sequence[Any]) -> Iterator[Outcome]:
        folders = folders_of(tasks, job.folder)
        for folder in folders:  # before any work
            refuse_file(folder)
            refuse_to_replace(folder, OF_A_RECORDING, study.files)
        names = [folder.name for folder in folders]
        work = partial(analyse_and_report, analyse, folders, job=job)
        for outcome in _executor(progress, names, workers)(work, tasks):
            number = outcome.item.number
            if outcome.error is None:
                result, pages[number] = outcome.result
                yield type(outcome)(outcome.item, result)
            else:
                pages[number] = Reported(names[number], error=outcome.error)
                yield outcome

    with for_one_run(job.folder):
        analysed = _analysed(study, job, progress, executor)
        done = tuple(pages[number] for number in sorted(pages))
        return (*done, *_device(analysed, job.folder, done, progress))


def report_population(job: Job, progress: Progress | None, workers: int) -> tuple[Reported, ...]:
    """The population part of a study alone: no reports of the recordings.

    Parameters
    ----------
    job : Job
        Whose source is a study.
    progress : callable or None
    workers : int
        Processes for the recordings.

    Returns
    -------
    tuple of Reported
        Of recordings that failed, and of the device where any of them could be used.

    Raises
    ------
    InputError
        Where the source is no study, or the settings cannot be used.
    """
    if job.source.suffix.lower() != ".toml":
        raise InputError(
            f"{job.source}: a population needs a study (.toml) that names the recordings and "
            "their users; for a single recording there is 'bayeshaptic report'"
        )
    study = _read(job)

    def executor(analyse: Callable[..., Any], tasks: Sequence[Any]) -> Iterator[Outcome]:
        names = [Path(folder).name for folder in folders_of(tasks, job.folder)]
        yield from _executor(progress, names, workers)(analyse, tasks)

    with for_one_run(job.folder):
        analysed = _analysed(study, job, progress, executor)
        failed = tuple(Reported(one.name, error=one.error) for one in analysed.failed)
        return (*failed, *_device(analysed, job.folder, None, progress))


def analyse_and_report(
    analyse: Callable[..., Any],
    folders: Sequence[Path],
    task: Any,
    part: Progress | None = None,
    *,
    job: Job,
) -> tuple[Any, Reported]:
    """Analyse one recording and write its report: in whatever process this runs.

    Parameters
    ----------
    analyse : callable
        From a task to its analysis.
    folders : sequence of Path
        Of the reports, by the number of the task.
    task : Task
    part : callable, optional
        Progress of this recording.
    job : Job
        That of the study.
    """
    folder = folders[task.number]
    began = time.perf_counter()
    with kept_until_done(checkpoints_of(folder)) as kept:
        task = replace(task, options=replace(task.options, checkpoints=kept))
        result = analyse(task, part)
        origin = provenance(
            job.command,
            job.settings.facts(),
            job.settings.seed,
            job.source if task.entry.more else task.entry.path,
            {"analyse": time.perf_counter() - began},
        )
        return result, reported(folder.name, result, folder, origin)


def folders_of(tasks: Sequence[Any], parent: Path) -> tuple[Path, ...]:
    """A folder for each recording, numbered where two have the same name."""
    names = names_of([task.entry for task in tasks])
    return tuple(parent / name for name in names)


def _read(job: Job) -> Study:
    refuse_file(job.folder)
    for option in ("rows", "seconds"):
        if getattr(job.settings, option) is not None:
            raise InputError(
                f"--{option} is for a single recording; for a study write {option} = [A, B] in "
                f"{job.source}, beside the recording's file"
            )
    if job.settings.held is not None:
        raise InputError(
            f"--held is for a single recording; in {job.source}, who held the device is its user"
        )
    for option in ("columns", "period_s", "encoder_resolution"):
        if getattr(job.settings, option) is not None:
            raise InputError(
                f"--{option.replace('_', '-')} is for a single recording; for a study write it in "
                f"{job.source}, in the table [device]"
            )
    study = read_study(job.source, job.settings.allow_outside)
    refuse_to_replace(job.folder, NAMES, study.files)
    return study


def _analysed(
    study: Study, job: Job, progress: Progress | None, executor: Executor
) -> StudyAnalysis:
    settings = job.settings
    return analyse_study(
        study,
        settings.model,
        settings.close_loop,
        replace(settings, progress=None if progress is None else _scaled(progress, _WRITING)),
        executor,
    )


def _device(
    study: StudyAnalysis,
    folder: Path,
    done: Sequence[Reported] | None,
    progress: Progress | None,
) -> tuple[Reported, ...]:
    """The page of the device, shorter without reports; none where no recording could be used."""
    if study.limit is None:
        return ()
    if progress is not None:
        progress(_WRITING, f"{study.name}: writing the report")
    pages = {one.name: one.page for one in done or () if one.page is not None}
    page = write_study_report(study, folder, pages, walls=done is not None)
    warnings = tuple(
        explained(n) for n in study.notices if n.level == "warning" and n.topic != "recordings"
    )
    return (Reported(study.name, page, study_headline(study), warnings=warnings),)


def _executor(progress: Progress | None, names: Sequence[str], workers: int) -> Executor:
    """Processes, or one recording after the other with the progress of each."""
    if workers > 1 and len(names) > 1:
        return executors.processes(workers)

    def run(job: Callable[..., Any], tasks: Sequence[Any]) -> Iterator[Outcome]:
        for task in tasks:
            part = _part(progress, task.number, len(tasks), names[task.number])
            yield from executors.serial(partial(_with_progress, job, part), [task])

    return run


def _with_progress(job: Callable[..., Any], part: Progress | None, task: Any) -> Any:
    return job(task, part)


def _part(progress: Progress | None, index: int, count: int, name: str) -> Progress | None:
    """The progress of one recording as that of the whole study."""
    if progress is None:
        return None
    recordings = 0.8  # share of the progress that the recordings take
    whole = _scaled(progress, _WRITING * recordings)
    return lambda share, word: whole((index + share) / count, f"{name}: {word}")


def _scaled(progress: Progress, most: float) -> Progress:
    return lambda share, word: progress(most * share, word)
