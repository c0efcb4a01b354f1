"""``bayeshaptic population``: what the recordings of a study say together."""

from __future__ import annotations

import argparse
from pathlib import Path

from bayeshaptic.commands.options import (
    add_analysis_options,
    add_quiet,
    add_workers,
    place,
    settings_from,
    workers_from,
)

NAME = "population"
SUMMARY = "what a study says of people not yet seen"
DESCRIPTION = """\
Analyse every recording of a study and report what they say together: how much people differ, the
critical stiffness for a person not yet seen, over configurations, and whether nobody holding the
device is worse. This is the part of 'bayeshaptic report STUDY' that is about all recordings; none
has a report of its own here.

The folder gets report.html (one page, works offline), population.json and the figures as PNG. What
the study has no recordings for (one user only, nobody holding it, no configurations) is left out,
and the page says so. A recording that fails is listed with its error; the exit status is then 1."""
EXAMPLES = """\
  bayeshaptic population study.toml -o population/
  bayeshaptic population study.toml --no-loop --workers 2"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The study, the folder, and how to analyse."""
    parser.add_argument(
        "source",
        type=Path,
        metavar="STUDY",
        help="a study (.toml): one device, and its recordings with their users and configurations",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=place,
        metavar="DIR",
        help="folder for the result, made if need be; an older one in it is replaced (default: "
        "./NAME-population, NAME being the study's name without its ending)",
    )
    add_workers(parser)
    add_analysis_options(parser)
    add_quiet(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the population; 0, or 1 where a recording failed."""
    from bayeshaptic.commands.talk import Talk
    from bayeshaptic.jobs.job import Job
    from bayeshaptic.jobs.study import report_population
    from bayeshaptic.recordings.from_columns import recording_name

    folder = arguments.output or Path(f"{recording_name(arguments.source)}-population")
    job = Job(arguments.source, folder, settings_from(arguments))
    with Talk(arguments.quiet) as talk:
        failed = talk.tell(report_population(job, talk.progress, workers_from(arguments)))
    return 1 if failed else 0
