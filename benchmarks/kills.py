"""Killed, out of disk, short of workers: every resume completes, with the results of a quiet run.

    python -m benchmarks.kills               30 kills, 5 full disks, a killed worker of each kind
    python -m benchmarks.kills --kills 4 --disks 1

Short recordings are reported by the command line; at a random moment the process (or a worker of
it) gets a signal, or its disk is full. Five seconds later none of its processes may be alive, and
every file under its final name must be whole; then the same command is run again, which must
succeed, leave no draft behind, and give the numbers of the run that nobody disturbed. Needs Linux,
and for the full disks the right to mount one.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

RECORDINGS = 2
SECONDS = 4
MOST_SECONDS_AFTER = 5.0
OPTIONS = ("--model", "rigid", "--device", "phantom", "--band", "1,25", "--no-loop", "--quiet")
KEEPING = """
import sys
from bayeshaptic import cli
from bayeshaptic.inference.saved import checkpoint
checkpoint.EVERY_S = 0.0
sys.exit(cli.main())
"""
MARK = "BAYESHAPTIC_KILLS"  # in the environment of every process of a run


@dataclass
class Tally:
    """What became of one kind of disturbance."""

    runs: int = 0
    completed: int = 0
    equal: int = 0
    wrong: list[str] = field(default_factory=list)


def command(kind: str, place: Path, out: Path, more: tuple[str, ...] = ()) -> list[str]:
    """A report of one recording, or a batch of all."""
    source = place / "in" if kind == "batch" else place / "in" / "p0.csv.gz"
    start = [sys.executable, "-m", "bayeshaptic", kind, str(source), "-o", str(out)]
    return [*start, *OPTIONS, *(("--workers", "2") if kind == "batch" and not more else more)]


def started(words: list[str], mark: str) -> subprocess.Popen[str]:
    """A process of its own session whose descendants carry `mark`."""
    return subprocess.Popen(
        words,
        env=os.environ | {MARK: mark},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def alive(mark: str) -> list[int]:
    """Processes that carry `mark`."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{MARK}={mark}".encode() in (folder / "environ").read_bytes().split(b"\0"):
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def left_after(mark: str) -> list[int]:
    """Processes that live on five seconds after."""
    until = time.monotonic() + MOST_SECONDS_AFTER
    while time.monotonic() < until and alive(mark):
        time.sleep(0.1)
    return alive(mark)


def torn(out: Path) -> list[str]:
    """Files under their final names that are not whole."""
    found = []
    for path in out.rglob("*"):
        if any(part.startswith(".") for part in path.relative_to(out).parts) or path.is_dir():
            continue
        content = path.read_bytes()
        try:
            if path.suffix == ".json":
                json.loads(content)
            whole = path.suffix != ".html" or content.rstrip().endswith(b"</html>")
        except ValueError:
            whole = False
        if not whole or not content:
            found.append(path.name)
    return found


def results(out: Path) -> dict[str, Any]:
    """The numbers of every report, without what times and places they hold."""
    found = {}
    for path in sorted(out.rglob("summary.json")):
        summary = json.loads(path.read_text(encoding="utf-8"))
        summary["posterior"].pop("seconds")
        summary["provenance"].pop("seconds"), summary["provenance"].pop("command")
        found[path.parent.name if path.parent != out else "p0"] = summary
    return found


def drafts(out: Path) -> list[str]:
    """What an interrupted run left, beside or below `out`."""
    return [path.name for path in (*out.rglob(".*"), *out.parent.glob(".report-*"))]


def finish(tally: Tally, kind: str, place: Path, out: Path, reference: dict[str, Any]) -> None:
    """Run the command again, and look."""
    done = subprocess.run(command(kind, place, out), capture_output=True, text=True)
    if done.returncode == 0 and not drafts(out):
        tally.completed += 1
    else:
        tally.wrong.append(f"resume: {done.returncode} {done.stderr.strip()[-200:]} {drafts(out)}")
    wanted = reference if kind == "batch" else {"p0": reference["p0"]}
    tally.equal += results(out) == wanted


def one_kill(
    tally: Tally, kind: str, number: signal.Signals, place: Path, reference: Any, delay: float
) -> None:
    """Kill the process after `delay` seconds, and go on."""
    tally.runs += 1
    out = place / f"out-{kind}-{number.name}-{tally.runs}"
    out.parent.mkdir(exist_ok=True)
    mark = out.name
    process = started(command(kind, place, out), mark)
    time.sleep(delay)
    process.send_signal(number)
    _, said = process.communicate()
    if left := left_after(mark):
        tally.wrong.append(f"alive after {MOST_SECONDS_AFTER:g} s: {left}")
    if "Traceback" in said:
        tally.wrong.append(f"traceback after {delay:.1f} s: {said[-200:]}")
    if out.exists() and (files := torn(out)):
        tally.wrong.append(f"torn: {files}")
    finish(tally, kind, place, out, reference)
    shutil.rmtree(out, ignore_errors=True)


def one_disk(tally: Tally, place: Path, reference: Any, kilobytes: int) -> None:
    """A disk of so many kilobytes, enlarged for the second run."""
    tally.runs += 1
    disk = place / "disk"
    disk.mkdir(exist_ok=True)
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(disk)]
    subprocess.run(mount, check=True)
    try:
        out = disk / "out"
        process = started(command("batch", place, out), mark := f"disk-{tally.runs}")
        _, said = process.communicate()
        if process.returncode not in (1, 2) or "Traceback" in said:
            tally.wrong.append(f"{kilobytes} kB: status {process.returncode}, {said[-300:]}")
        if any(not line.startswith("bayeshaptic: ") for line in said.splitlines()):
            tally.wrong.append(f"{kilobytes} kB: {said[-300:]}")
        if left := left_after(mark):
            tally.wrong.append(f"alive: {left}")
        if files := torn(disk):
            tally.wrong.append(f"torn: {files}")
        subprocess.run(["mount", "-o", "remount,size=200m", str(disk)], check=True)
        finish(tally, "batch", place, out, reference)
    finally:
        subprocess.run(["umount", str(disk)], check=True)


def one_worker(tally: Tally, place: Path, reference: Any, more: tuple[str, ...]) -> None:
    """Kill a worker of a pool, or of a dask cluster, while it works: the same run completes."""
    tally.runs += 1
    out = place / f"out-worker-{tally.runs}-{len(more)}"
    process = started(command("batch", place, out, more), mark := out.name)
    victim = _worker(process, mark)
    if victim is None:
        tally.wrong.append("no worker was found to be killed")
    else:
        os.kill(victim, signal.SIGKILL)
    _, said = process.communicate()
    if process.returncode == 0 and victim is not None and not drafts(out):
        tally.completed += 1
    else:
        tally.wrong.append(f"status {process.returncode}: {said[-300:]} {drafts(out)}")
    tally.equal += results(out) == reference
    if left := left_after(mark):
        tally.wrong.append(f"alive: {left}")


def _worker(parent: subprocess.Popen[str], mark: str) -> int | None:
    """A process below `parent` that has worked for two seconds of processor time."""
    ticks = os.sysconf("SC_CLK_TCK")
    while parent.poll() is None:
        time.sleep(0.2)
        for pid in alive(mark):
            try:
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if pid != parent.pid and (int(fields[11]) + int(fields[12])) / ticks > 2.0:
                return pid
    return None


def one_sampler(tally: Tally, place: Path, reference: Any) -> None:
    """Kill a report as soon as its sampler has kept its state, and go on from there."""
    tally.runs += 1
    out = place / f"out-sampler-{tally.runs}"
    _, _, _, *words = command("report", place, out)
    process = started([sys.executable, "-c", KEEPING, *words], out.name)
    while process.poll() is None and not list(out.glob(".checkpoints/*.state")):
        time.sleep(0.002)
    process.kill()
    process.communicate()
    if not list(out.glob(".checkpoints/*.state")):
        tally.wrong.append("no state was kept")
    if left := left_after(out.name):
        tally.wrong.append(f"alive: {left}")
    finish(tally, "report", place, out, reference)


def prepared(place: Path) -> tuple[dict[str, Any], dict[str, float]]:
    """Recordings, the results of a run that nobody disturbs, and how long each kind takes."""
    (place / "in").mkdir()
    for number in range(RECORDINGS):
        words = ["simulate", "phantom", "--seconds", str(SECONDS), "--seed", str(number)]
        file = str(place / "in" / f"p{number}.csv.gz")
        subprocess.run([sys.executable, "-m", "bayeshaptic", *words, "-o", file], check=True)
    seconds = {}
    for kind in ("report", "batch"):
        began = time.perf_counter()
        subprocess.run(command(kind, place, place / f"quiet-{kind}"), check=True)
        seconds[kind] = time.perf_counter() - began
    return results(place / "quiet-batch"), seconds


def main() -> int:
    """The table; 1 where anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=30)
    parser.add_argument("--samplers", type=int, default=3)
    parser.add_argument("--disks", type=int, default=5)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    tallies: dict[str, Tally] = {}

    def attempt(name: str, run: Callable[..., None], *about: Any) -> None:
        tally = tallies.setdefault(name, Tally())
        run(tally, *about)
        print(f"{name}: {tally.runs} runs, {tally.completed} completed, {tally.equal} equal"
              f"{''.join(chr(10) + '  ' + line for line in tally.wrong)}", flush=True)  # fmt: skip

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        reference, seconds = prepared(place)
        print(f"undisturbed: {seconds}", flush=True)
        for number in range(arguments.kills):
            kind = "report" if number % 3 == 2 else "batch"
            how = signal.SIGKILL if number % 2 else signal.SIGTERM
            delay = float(rng.uniform(0.05, 1.0)) * seconds[kind]
            attempt(f"{kind}, {how.name}", one_kill, kind, how, place, reference, delay)
        for _ in range(arguments.samplers):
            attempt("sampler, SIGKILL", one_sampler, place, reference)
        for kilobytes in rng.integers(50, 3000, arguments.disks):
            attempt("full disk", one_disk, place, reference, int(kilobytes))
        attempt("pool worker killed", one_worker, place, reference, ())
        attempt("dask worker killed", one_worker, place, reference, ("--dask", "local"))
    print("\n| disturbance | runs | completed by the next run | equal to a quiet run | wrong |")
    print("| --- | --- | --- | --- | --- |")
    for name, tally in tallies.items():
        print(f"| {name} | {tally.runs} | {tally.completed} | {tally.equal} | {len(tally.wrong)} |")
    whole = all(t.runs == t.completed == t.equal and not t.wrong for t in tallies.values())
    return 0 if whole else 1


if __name__ == "__main__":
    sys.exit(main())
