"""From files to reports: one recording, one study, or many of either.

`report_source` is the job that the commands ``report`` and ``batch`` run, and that an executor can
carry to another process: it is called with plain picklable things, and hands back plain things.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.errors import InputError, describe
from bayeshaptic.recordings.read import recording_name
from bayeshaptic.report.index import Reported, write_index

if TYPE_CHECKING:
    from bayeshaptic.devices import Device
    from bayeshaptic.models import Prior
    from bayeshaptic.recordings.etfe import Etfe
    from bayeshaptic.recordings.recording import Recording

Progress = Callable[[float, str], None]
"""Called with the share done (0 to 1) and a word about it."""


@dataclass(frozen=True)
class Settings:
    """How recordings are read and analysed: the options of the command ``report``.

    Attributes
    ----------
    columns : str or None
        Mapping of the file's columns.
    period_s, encoder_resolution : float or None
    model : str
        "auto", "rigid", "free" or "grasped".
    device : str or None
        Name or path of a device file; for a study, instead of the study's own.
    delay_s, delay_sd_s : float or None
    band_hz : (float, float) or None
    seed : int
    close_loop : bool
        Whether to look for what the model lacks.
    """

    columns: str | None = None
    period_s: float | None = None
    encoder_resolution: float | None = None
    model: str = "auto"
    device: str | None = None
    delay_s: float | None = None
    delay_sd_s: float | None = None
    band_hz: tuple[float, float] | None = None
    seed: int = 0
    close_loop: bool = True


@dataclass(frozen=True)
class Job:
    """One recording or study, and the folder for its report."""

    source: Path
    folder: Path
    settings: Settings


def report_source(job: Job, progress: Progress | None = None) -> tuple[Reported, ...]:
    """Report on a recording, a table of a frequency response, or a study.

    Of a study, every recording has a report in a folder of its own and ``index.html`` lists them; a
    recording that fails is listed with its error and does not stop the others.

    Parameters
    ----------
    job : Job
    progress : callable, optional
        Called with the share done and a word about it.

    Returns
    -------
    tuple of Reported

    Raises
    ------
    InputError
        Where the source or the settings cannot be used.
    """
    refuse_file(job.folder)
    if job.source.suffix.lower() == ".toml":
        return _report_study(job, progress)
    return (_report_recording(job, progress),)


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


def refuse_file(folder: Path) -> None:
    """Say before any work that a report cannot be written there.

    Raises
    ------
    InputError
        Where `folder`, or the nearest of its parents that exists, is not a folder to write in.
    """
    nearest = next(path for path in (folder, *folder.absolute().parents) if path.exists())
    if not nearest.is_dir():
        raise InputError(f"{nearest} is a file; name a folder for the report with -o")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InputError(f"{nearest}: no permission to write there; name another folder with -o")


def _report_recording(job: Job, progress: Progress | None) -> Reported:
    from bayeshaptic.devices import load_device
    from bayeshaptic.recordings.read import read_measurement
    from bayeshaptic.recordings.recording import Recording

    settings = job.settings
    device = None if settings.device is None else load_device(settings.device)
    resolution = settings.encoder_resolution
    if resolution is None and device is not None:
        resolution = device.encoder_resolution
    measurement = read_measurement(
        job.source,
        columns=settings.columns,
        period_s=settings.period_s,
        encoder_resolution=resolution,
        kind=device.kind if device else None,
        default_period_s=device.period_s if device else None,
    )
    if device is not None and isinstance(measurement, Recording):
        measurement = replace(measurement, device=device.name)
    return _report(
        measurement, recording_name(job.source), job.folder, settings, device, {}, None, progress
    )


def _report_study(job: Job, progress: Progress | None) -> tuple[Reported, ...]:
    from bayeshaptic.devices import load_device
    from bayeshaptic.models import prior_from_table
    from bayeshaptic.recordings.study import read_study

    settings = job.settings
    _refuse_reading_options(job)
    study = read_study(job.source)
    device = study.device if settings.device is None else load_device(settings.device)
    prior = {name: prior_from_table(name, table) for name, table in study.prior.items()}
    names = _distinct([recording_name(entry.path) for entry in study.entries])
    done: list[Reported] = []
    for index, (name, entry) in enumerate(zip(names, study.entries, strict=True)):
        part = _part(progress, index, len(names), name)
        try:
            folder = job.folder / name
            measurement = study.read(entry)
            held = entry.user is not None
            done.append(_report(measurement, name, folder, settings, device, prior, held, part))
        except Exception as error:
            done.append(Reported(name, error=describe(error)))
    if any(reported.page for reported in done):
        write_index(study.name, done, job.folder)
    return tuple(done)


def _report(
    measurement: Recording | Etfe,
    name: str,
    folder: Path,
    settings: Settings,
    device: Device | None,
    prior: Mapping[str, Prior],
    held: bool | None,
    progress: Progress | None,
) -> Reported:
    """Analyse one measurement and write its report."""
    from bayeshaptic.diagnosis.analysis import analyse
    from bayeshaptic.diagnosis.closed import Closed, close_loop
    from bayeshaptic.report import write_report
    from bayeshaptic.report.headline import headline
    from bayeshaptic.report.loop_words import in_short
    from bayeshaptic.report.summary import analysis_of

    options: dict[str, Any] = {
        "model": settings.model,
        "device": device,
        "delay_s": settings.delay_s,
        "delay_sd_s": settings.delay_sd_s,
        "band_hz": settings.band_hz,
        "prior": prior,
        "held": held,
        "seed": settings.seed,
        "progress": progress,
    }
    run = close_loop if settings.close_loop else analyse
    result = run(measurement=measurement, **options)
    page = write_report(result, folder)
    summary = json.loads((page.parent / "summary.json").read_text(encoding="utf-8"))
    warnings = tuple(
        notice.text for notice in analysis_of(result).notices if notice.level == "warning"
    )
    remark = in_short(result) if isinstance(result, Closed) else ""
    return Reported(name, page, headline(result), remark, summary, warnings)


def _refuse_reading_options(job: Job) -> None:
    for option in ("columns", "period_s", "encoder_resolution"):
        if getattr(job.settings, option) is not None:
            raise InputError(
                f"--{option.replace('_', '-')} is for a single recording; for a study write it in "
                f"{job.source}, in the table [device]"
            )


def _distinct(names: list[str]) -> list[str]:
    """The names, numbered where one comes more than once."""
    return [
        name if names.count(name) == 1 else f"{name}-{names[: index + 1].count(name)}"
        for index, name in enumerate(names)
    ]


def _part(progress: Progress | None, index: int, count: int, name: str) -> Progress | None:
    """The progress of one recording as that of the whole study."""
    if progress is None:
        return None
    whole = progress
    return lambda share, word: whole((index + share) / count, f"{name}: {word}")
