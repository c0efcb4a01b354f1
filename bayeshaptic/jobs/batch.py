"""From files to reports: one recording, one study, or many of either.

`report_source` is the job that the commands ``report`` and ``batch`` run, and that an executor can
carry to another process: it is called with plain picklable things, and hands back plain things.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.read import recording_name
from bayeshaptic.report.reported import Reported
from bayeshaptic.types import Progress

if TYPE_CHECKING:
    from bayeshaptic.devices import Device
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.recordings.recording import Recording
    from bayeshaptic.recordings.response.etfe import Etfe


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
        from bayeshaptic.jobs.study_batch import report_study

        return report_study(job, progress, workers)
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
    return _report(measurement, recording_name(job.source), job.folder, settings, device, progress)


def _report(
    measurement: Recording | Etfe,
    name: str,
    folder: Path,
    settings: Settings,
    device: Device | None,
    progress: Progress | None,
) -> Reported:
    """Analyse one measurement and write its report."""
    from bayeshaptic.diagnosis.analysis import analyse
    from bayeshaptic.diagnosis.closed import close_loop

    options: dict[str, Any] = {
        "model": settings.model,
        "device": device,
        "delay_s": settings.delay_s,
        "delay_sd_s": settings.delay_sd_s,
        "band_hz": settings.band_hz,
        "held": None,
        "seed": settings.seed,
        "progress": progress,
    }
    run = close_loop if settings.close_loop else analyse
    return reported(name, run(measurement=measurement, **options), folder)


def reported(name: str, result: Analysis | Closed, folder: Path) -> Reported:
    """Write the report of one analysed measurement, and say what is in it.

    Parameters
    ----------
    name : str
    result : Analysis or Closed
    folder : Path
    """
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.report import write_report
    from bayeshaptic.report.headline import headline
    from bayeshaptic.report.loop.words import in_short
    from bayeshaptic.report.summary import analysis_of

    page = write_report(result, folder)
    warnings = tuple(
        notice.text for notice in analysis_of(result).notices if notice.level == "warning"
    )
    remark = in_short(result) if isinstance(result, Closed) else ""
    return Reported(name, page, headline(result), remark, warnings)
