"""``bayeshaptic batch``: many reports, side by side."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bayeshaptic.commands.options import (
    add_analysis_options,
    add_quiet,
    command_line,
    count,
    place,
    settings_from,
)

if TYPE_CHECKING:
    from bayeshaptic.jobs.manifest import ManifestEntry
    from bayeshaptic.report.reported import Reported
    from bayeshaptic.types import Executor

NAME = "batch"
SUMMARY = "report on many studies or recordings, side by side"
DESCRIPTION = """\
Make the report of every study or recording named, several at a time: on the cores of this machine,
or on a dask cluster. The folder gets index.html and index.csv (every recording, its critical
stiffness and verdict) and manifest.json; run again, the same command goes on where it stopped: what
is done and unchanged is left alone. One that fails is named with its error, in failed.csv too, and
does not stop the others; the exit status is then 1."""
EXAMPLES = """\
  bayeshaptic batch studies/*.toml -o reports/
  bayeshaptic batch recordings/ -o reports/ --workers 8
  bayeshaptic batch studies/*.toml --dask tcp://scheduler:8786"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The options of `report`, for all sources alike, and where the work is done."""
    parser.add_argument(
        "sources",
        type=Path,
        nargs="+",
        metavar="STUDY_OR_FOLDER",
        help="a study (.toml), a recording, or a folder of studies and recordings",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=place,
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
        help="'local', or the address of a dask scheduler, as in tcp://scheduler:8786; it and its "
        "workers need bayeshaptic and the same files under the same paths "
        "(pip install 'bayeshaptic[dask]')",
    )
    parser.add_argument(
        "--again", action="store_true", help="do again what an earlier run has done, unchanged"
    )
    parser.add_argument(
        "--log",
        choices=("text", "json"),
        default="text",
        help="lines for people, or one JSON object for each source that ends (default: text)",
    )
    add_analysis_options(parser)
    add_quiet(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the reports; 0 where all came out, else 1."""
    import json

    from bayeshaptic.jobs.own_process import lighten_imports

    lighten_imports()  # before what loads SciPy
    from bayeshaptic.commands.talk import Talk
    from bayeshaptic.jobs.batch import run_batch

    as_json = arguments.log == "json"
    before = 0  # done by an earlier run, which says nothing of how long the others take
    with Talk(arguments.quiet or as_json) as talk:

        def tell(
            entry: ManifestEntry, reports: tuple[Reported, ...], done: int, count: int
        ) -> None:
            nonlocal before
            if as_json:
                facts = {"source": entry.source, "state": entry.state, "error": entry.error}
                more = {"seconds": entry.seconds, "done": done, "of": count}
                talk.write(json.dumps(facts | more))
            elif reports:
                talk.tell(reports)
            elif entry.error is not None:
                named = entry.error.startswith(entry.source)
                talk.complain(entry.error if named else f"{entry.source}: {entry.error}")
            else:
                talk.say(f"{entry.source}: done before, unchanged")
                before += 1
            left = count - before
            talk.progress((done - before) / left if left else 1.0, f"{done} of {count}")

        entries = run_batch(
            arguments.sources,
            arguments.output,
            settings_from(arguments),
            _executor(arguments),
            resume=not arguments.again,
            command=command_line(),
            tell=tell,
        )
        talk.say(f"reports: {arguments.output.absolute() / 'index.html'}")
    return 1 if any(entry.state != "done" for entry in entries) else 0


def _executor(arguments: argparse.Namespace) -> Executor:
    """Where the jobs run."""
    from bayeshaptic.jobs import executors

    if arguments.dask is not None:
        return executors.dask(arguments.dask)
    if arguments.workers == 1:
        return executors.serial
    return executors.processes(arguments.workers or executors.usable_cores())
