"""Make the report of the example study again: python examples/study/make_report.py

Writes docs/study: the page without the recordings' own pages, its numbers and its figures. What a
user would run is `bayeshaptic report examples/study/study.toml -o out/`, which has those as well.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import bayeshaptic as bh
from bayeshaptic.jobs import executors
from bayeshaptic.report.study.write import write_study_report
from bayeshaptic.threads import one_thread_from_the_start

FOLDER = Path(__file__).parent
REPORT = FOLDER.parents[1] / "docs" / "study"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--workers", type=int, default=executors.usable_cores(), metavar="N")
    parser.add_argument("-o", "--output", type=Path, default=REPORT)
    given = parser.parse_args()
    executor = executors.processes(given.workers) if given.workers > 1 else None
    study = bh.analyse_study(
        bh.read_study(FOLDER / "study.toml"), close_loop=True, executor=executor
    )
    print(write_study_report(study, given.output))


if __name__ == "__main__":
    one_thread_from_the_start()
    main()
