"""CPU time of whole reports beside an older version of the package, recording by recording.

    python -m benchmarks.costs.reports [--old PATH] [--old-limit S] [--only new] [--count 60]
                                 [--seconds S] [-o FILE]

60 simulated recordings of 30 s, in an order that makes the first few like the rest: 14 clean, 30 of
the effects that the library promises, 16 of pairs; every other one without a device file.  Each is
analysed by `bayeshaptic report` of this version and of the checkout at PATH, one after the other;
an older report that takes longer than its limit counts as that long, "at least".
FILE (by default reports.jsonl) gets a line each, and what is in it already is not done again: the
benchmark may be stopped, or given some SECONDS, and gone on with; one version alone may be run.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.devices import load_device
from bayeshaptic.rig import simulate, write_recording
from benchmarks.recordings.blind import CASES, LISTED, PAIRS, SINGLE, Job, bench_of, jobs_for

HERE = Path(__file__).resolve().parent
SEED = 970_000
CLEAN, PAIRED = 14, 16
MOST_S = 1500.0  # of CPU time, after which a report is given up
OLD_LIMIT_S = 240.0  # the same of the older version
CLEAN_S, SINGLE_S, ANY_S = 8.0, 20.0, 60.0  # what is asked for


def jobs() -> list[tuple[Job, bool]]:
    """Every recording, and whether its device file is given."""
    promised = list(SINGLE)[:LISTED]
    wanted: list[tuple[str, ...]] = [()] * CLEAN
    wanted += [(effect,) for effect in promised for _ in range(2)]
    wanted += [PAIRS[i // 2 % len(PAIRS)] for i in range(PAIRED)]
    made = []
    for i, effects in enumerate(wanted):
        choice = jobs_for(effects, len(CASES), SEED + 10 * i)
        made.append((choice[i // 2 % len(choice)], i % 2 == 0))
    order = np.random.default_rng(SEED).permutation(len(made))
    return [made[i] for i in order]


def line_of(job: Job, with_file: bool, path: Path, out: Path) -> list[str]:
    """The command that a person would type."""
    device = CASES[job.case][0]
    line = [sys.executable, "-m", "bayeshaptic", "report", str(path), "-o", str(out), "--quiet"]
    if with_file:
        return [*line, "--device", device]
    known = load_device(device)
    line += ["--delay-s", str(known.delay_s)]
    grid = known.encoder_resolution
    return line if grid is None else [*line, "--encoder-resolution", str(grid)]


def measured(line: list[str], version: Path, out: Path, limit_s: float) -> dict[str, Any]:
    """CPU seconds of a command by the package at `version`, and what it found."""
    import resource

    environment = {**os.environ, "PYTHONPATH": str(version), "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # an installation has its byte code

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(limit_s)))

    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run(
        line, env=environment, capture_output=True, text=True, preexec_fn=limited, cwd=out.parent
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    took = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    found: dict[str, Any] = {"cpu_s": round(took, 2), "status": done.returncode}
    if done.returncode == 0:
        summary = json.loads((out / "summary.json").read_text())
        found["verdict"] = summary["diagnosis"]["verdict"]
        found["k_db"] = summary["critical_stiffness"]["db"]["q50"]
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--old", type=Path, help="a checkout of an older version")
    parser.add_argument("--old-limit", type=float, default=OLD_LIMIT_S, help="CPU s a report of it")
    parser.add_argument("--only", choices=("new", "old"), help="this version alone")
    parser.add_argument("--count", type=int, default=60, help="so many recordings")
    parser.add_argument("--seconds", type=float, default=np.inf, help="begin none after that")
    parser.add_argument("-o", "--output", type=Path, default=HERE / "reports.jsonl")
    asked = parser.parse_args()
    versions = {"new": HERE.parents[1]} | ({"old": asked.old.resolve()} if asked.old else {})
    versions = {name: at for name, at in versions.items() if asked.only in (None, name)}
    limits = {"new": MOST_S, "old": asked.old_limit}
    rows: dict[tuple[int, str], dict[str, Any]] = {}
    if asked.output.exists():
        for text in asked.output.read_text().splitlines():
            row = json.loads(text)
            rows[row["number"], row["version"]] = row
    began = time.perf_counter()
    for number, (job, with_file) in enumerate(jobs()[: asked.count]):
        missing = {name: at for name, at in versions.items() if (number, name) not in rows}
        if not missing or time.perf_counter() - began > asked.seconds:
            continue
        with tempfile.TemporaryDirectory() as folder:
            path, out = Path(folder) / "recording.npz", Path(folder) / "out"
            write_recording(path, simulate(bench_of(job), seed=job.seed))
            for name, version in missing.items():
                row = {
                    "number": number,
                    "version": name,
                    "case": job.case,
                    "effects": job.effects,
                    "with_file": with_file,
                    **measured(line_of(job, with_file, path, out), version, out, limits[name]),
                }
                rows[number, name] = row
                with asked.output.open("a") as file:
                    file.write(json.dumps(row) + "\n")
                print(json.dumps(row), flush=True)
    summarise(rows)


def summarise(rows: dict[tuple[int, str], dict[str, Any]]) -> None:
    """The table: medians, the longest, and the ratios; then what was asked for."""
    groups = {"clean": 0, "one effect": 1, "two effects": 2}
    print("\n| recordings | n | CPU, s: median | longest | older: median | ratio: median | least |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    new = [row for row in rows.values() if row["version"] == "new" and row["status"] == 0]
    for name, size in {**groups, "all": -1}.items():
        for file in (True, False, None) if size == -1 else (None,):
            own = [
                row
                for row in new
                if size in (-1, len(row["effects"])) and file in (None, row["with_file"])
            ]
            if not own:
                continue
            older = [rows[row["number"], "old"] for row in own if (row["number"], "old") in rows]
            which = {True: ", device file", False: ", no device file", None: ""}[file]
            times = [row["cpu_s"] for row in own]
            cells = [f"{np.median(times):.1f}", f"{max(times):.1f}"]
            if older:
                ratios = [old["cpu_s"] / rows[old["number"], "new"]["cpu_s"] for old in older]
                cells += [f"{np.median([old['cpu_s'] for old in older]):.1f}"]
                cells += [f"{np.median(ratios):.2f}", f"{min(ratios):.2f}"]
            print(f"| {name}{which} | {len(own)} | {' | '.join(cells)} |")
    for name, size, most in (
        ("clean", 0, CLEAN_S),
        ("one effect", 1, SINGLE_S),
        ("all", -1, ANY_S),
    ):
        times = [row["cpu_s"] for row in new if size in (-1, len(row["effects"]))]
        over = sum(time_s > most for time_s in times)
        print(f"{name}: {over} of {len(times)} take over {most:g} CPU s")
    stopped = [row for row in rows.values() if row["version"] == "old" and row["status"] != 0]
    print(f'older reports stopped, or failed, and counted as "at least": {len(stopped)}')
    failed = [row["number"] for row in rows.values() if row["version"] == "new" and row["status"]]
    print(f"present reports that failed: {failed or 'none'}")


if __name__ == "__main__":
    main()
