"""From one recording, or a table of a frequency response, to its report."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bayeshaptic.devices import Device, load_device
from bayeshaptic.diagnosis.analyse import analyse
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.faq import explained
from bayeshaptic.inference.saved.checkpoint import kept_until_done
from bayeshaptic.jobs.job import Job, checkpoints_of
from bayeshaptic.provenance import provenance
from bayeshaptic.recordings.from_columns import recording_name
from bayeshaptic.recordings.measurement import read_measurement
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.report.draft import refuse_to_replace
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop.words import in_short
from bayeshaptic.report.reported import Reported
from bayeshaptic.report.write import NAMES, write_report
from bayeshaptic.types import Progress


def report_recording(job: Job, progress: Progress | None) -> Reported:
    """Read, analyse and report; see `bayeshaptic.jobs.batch.report_source`."""
    refuse_to_replace(job.folder, NAMES, [job.source])
    settings = job.settings
    began = time.perf_counter()
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
        rows=settings.rows,
        seconds=settings.seconds,
    )
    if device is not None and isinstance(measurement, Recording):
        measurement = replace(measurement, device=device.name)
    read = time.perf_counter() - began
    return _report(measurement, job, read, device, progress)


def _report(
    measurement: Recording | Etfe,
    job: Job,
    seconds_of_reading: float,
    device: Device | None,
    progress: Progress | None,
) -> Reported:
    """Analyse one measurement and write its report."""
    settings = job.settings
    began = time.perf_counter()
    run = close_loop if settings.close_loop else analyse
    with kept_until_done(checkpoints_of(job.folder)) as kept:
        options = replace(settings, device=device, progress=progress, checkpoints=kept)
        result = run(measurement, settings.model, options)
        seconds = {"read": seconds_of_reading, "analyse": time.perf_counter() - began}
        origin = provenance(job.command, settings.facts(), settings.seed, job.source, seconds)
        return reported(recording_name(job.source), result, job.folder, origin)


def reported(
    name: str, result: Result, folder: Path, origin: Mapping[str, Any] | None = None
) -> Reported:
    """Write the report of one analysed measurement, and say what is in it.

    Parameters
    ----------
    name : str
    result : Analysis or Closed
    folder : Path
    origin : mapping, optional
        See `bayeshaptic.provenance`.
    """
    page = write_report(result, folder, origin)
    warnings = tuple(explained(n) for n in result.analysis.notices if n.level == "warning")
    remark = in_short(result.closed) if result.closed else ""
    return Reported(name, page, headline(result), remark, warnings)
