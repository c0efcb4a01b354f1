"""How much sooner two workers end a batch than one: processes, and a local Dask cluster.

    python -m benchmarks.costs.workers                     24 recordings of 10 s
    python -m benchmarks.costs.workers --recordings 12

The recordings are of both devices, free and held, every sixth one with dry friction; all runs are
`bayeshaptic batch` with the defaults, one after the other. On a machine that does other work the
ratios say nothing; the table says how busy it was.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

RUNS = (
    ("one process", ("--workers", "1")),
    ("two processes", ("--workers", "2")),
    ("Dask, local", ("--dask", "local")),
)


def record(folder: Path, recordings: int, seconds: float) -> None:
    """Make the recordings of the bench."""
    for i in range(recordings):
        device, held = ("lhifam", "phantom")[i % 2], i // 2 % 2
        words = ["simulate", device, "--held" if held else "--free", "--seed", str(7000 + i)]
        words += ["--effect", "coulomb_friction"] if i % 6 == 5 else []
        words += ["--seconds", str(seconds), "--quiet", "-o", str(folder / f"r{i:02}.csv.gz")]
        subprocess.run([sys.executable, "-m", "bayeshaptic", *words], check=True)


def timed(words: list[str]) -> tuple[float, float]:
    """Wall and processor seconds of a command that must succeed."""
    before, start = os.times(), time.perf_counter()
    subprocess.run([sys.executable, "-m", "bayeshaptic", *words], check=True)
    wall, after = time.perf_counter() - start, os.times()
    cpu = (after.children_user - before.children_user) + (
        after.children_system - before.children_system
    )
    return wall, cpu


def main() -> None:
    """Time every way to run the batch, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--recordings", type=int, default=24)
    parser.add_argument("--seconds", type=float, default=10.0)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "in"
        folder.mkdir()
        record(folder, asked.recordings, asked.seconds)
        print(f"{asked.recordings} recordings of {asked.seconds:g} s, {os.cpu_count()} cores")
        print("| run | wall, s | CPU, s | times as fast | load |\n| --- | --- | --- | --- | --- |")
        alone = 0.0
        for name, more in RUNS:
            out = Path(place) / name.replace(" ", "-")
            wall, cpu = timed(["batch", str(folder), "-o", str(out), "--quiet", *more])
            alone = alone or wall
            load = os.getloadavg()[0]
            print(
                f"| {name} | {wall:.0f} | {cpu:.0f} | {alone / wall:.2f} | {load:.1f} |", flush=True
            )


if __name__ == "__main__":
    main()
