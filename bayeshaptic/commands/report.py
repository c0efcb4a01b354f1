"""``bayeshaptic report``: from a recording or a study to an uncertainty report."""

from __future__ import annotations

import argparse
from pathlib import Path

from bayeshaptic.commands.options import (
    add_analysis_options,
    add_quiet,
    add_workers,
    command_line,
    place,
    settings_from,
    workers_from,
)

NAME = "report"
SUMMARY = "report how stiff a wall may be, from a recording or a study"
DESCRIPTION = """\
Fit a model of the device to a recording of commanded force and measured position, with the
uncertainty of every parameter, and report the critical stiffness: how stiff a virtual wall may be
before it goes unstable, and what is safe at 5, 1 and 0.1 per cent risk.

The folder gets report.html (one page, works offline), summary.json, posterior.nc (ArviZ) and the
figures as PNG. Of a study it gets one report of the device: its users side by side, a person not
yet seen, configurations, the stiffness that is safe over all of them, population.json and
limits.json; every recording has a report in a folder of its own, which the page links. A recording
that fails is listed with its error; the exit status is then 1."""
EXAMPLES = """\
  bayeshaptic report lhifam-user.csv.gz --device lhifam -o out/
  bayeshaptic report bench.mat --columns "time=t*1e-6,force=iq[A],position=theta[rad]" --model free
  bayeshaptic report response.csv --period-s 0.001
  bayeshaptic report study.toml -o study-report/"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The source, the folder, and how to read and analyse."""
    parser.add_argument(
        "source",
        type=Path,
        metavar="RECORDING_OR_STUDY",
        help="a recording (.csv, .csv.gz, .mat, .h5, .npz) with columns time_s, force_n, "
        "position_m or time_s, torque_nm, angle_rad; a table of a frequency response; or a "
        "study (.toml)",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=place,
        metavar="DIR",
        help="folder for the report, made if need be; an older report in it is replaced "
        "(default: ./NAME-report, NAME being the source's name without its endings)",
    )
    add_workers(parser)
    add_analysis_options(parser)
    add_quiet(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the report; 0, or 1 where a recording of a study failed."""
    from bayeshaptic.jobs.own_process import collect_garbage_rarely, lighten_imports

    collect_garbage_rarely(1_000_000)
    lighten_imports()  # before what loads SciPy
    from bayeshaptic.commands.talk import Talk
    from bayeshaptic.jobs.batch import report_source
    from bayeshaptic.jobs.job import Job
    from bayeshaptic.recordings.from_columns import recording_name

    folder = arguments.output or Path(f"{recording_name(arguments.source)}-report")
    job = Job(arguments.source, folder, settings_from(arguments), command_line())
    with Talk(arguments.quiet) as talk:
        failed = talk.tell(report_source(job, talk.progress, workers_from(arguments)))
    return 1 if failed else 0
