"""``bayeshaptic batch``: many reports, side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from bayeshaptic.commands.options import add_analysis_options, add_quiet, count, settings_from

NAME = "batch"
SUMMARY = "report on many studies or recordings, side by side"
DESCRIPTION = """\
Make the report of every study or recording named, several at a time: on the cores of this machine,
or on a dask cluster. One that fails is named with its error and does not stop the others; the exit
status is then 1."""
EXAMPLES = """\
  bayeshaptic batch studies/*.toml -o reports/
  bayeshaptic batch studies/*.toml --workers 8
  bayeshaptic batch studies/*.toml --dask tcp://scheduler:8786"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `report`, for all sources alike, and where the work is done."""
    parser.add_argument(
        "sources",
        type=Path,
        nargs="+",
        metavar="STUDY",
        help="a study (.toml), or a recording",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("reports"),
        metavar="DIR",
        help="folder in which every study gets a folder of its own name (default: ./reports)",
    )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--workers",
        type=count,
        metavar="N",
        help="processes on this machine (default: one for each usable core)",
    )
    where.add_argument(
        "--dask",
        metavar="ADDRESS",
        help="address of a dask scheduler, for example tcp://scheduler:8786; it and its workers "
        "need bayeshaptic and the same files under the same paths "
        "(pip install 'bayeshaptic[dask]')",
    )
    add_analysis_options(parser)
    add_quiet(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the reports; 0 where all came out, else 1."""
    from bayeshaptic.commands.talk import Talk
    from bayeshaptic.jobs import executors
    from bayeshaptic.jobs.batch import jobs, report_source
    from bayeshaptic.jobs.job import refuse_file

    folder = arguments.output.absolute()
    refuse_file(folder)
    sources = [source.absolute() for source in arguments.sources]
    work = jobs(sources, folder, settings_from(arguments))
    if arguments.dask is not None:
        execute = executors.dask(arguments.dask)
    elif arguments.workers == 1:
        execute = executors.serial
    else:
        execute = executors.processes(arguments.workers or executors.usable_cores())
    failed = 0
    with Talk(arguments.quiet) as talk:
        talk.progress(0.0, f"0 of {len(work)}")
        for number, outcome in enumerate(execute(report_source, work), start=1):
            if outcome.error is not None:
                source = str(outcome.item.source)
                named = outcome.error.startswith(source)
                talk.complain(outcome.error if named else f"{source}: {outcome.error}")
                failed += 1
            else:
                failed += talk.tell(outcome.result)
            talk.progress(number / len(work), f"{number} of {len(work)}")
        talk.say(f"reports: {folder}")
    return 1 if failed else 0
