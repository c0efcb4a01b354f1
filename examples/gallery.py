"""The four reports of the documentation's gallery: python examples/gallery.py

Each is made from a simulated recording, so that what is in it is known: nothing, dry friction, an
encoder disc off its centre (which is not in the library of effects), and a controller that computes
the force from the motion.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

import bayeshaptic as bh
from bayeshaptic.rig import Bench, SimulatedRecording, WhiteNoise, run_loop, simulate
from bayeshaptic.threads import one_thread_from_the_start

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT))
from benchmarks.recordings.foreign import EccentricEncoder  # noqa: E402

FOLDER = ROOT / "docs" / "gallery"
SECONDS = 20.0
NOISE = WhiteNoise(0.05, 200.0, 0.7, SECONDS)


def clean() -> SimulatedRecording:
    """Nobody holds the device, and nothing is in it."""
    return simulate(Bench.from_device("phantom"), NOISE, seed=1)


def explained() -> SimulatedRecording:
    """Dry friction."""
    bench = Bench.from_device("phantom").with_effect("coulomb_friction", force=0.01)
    return simulate(bench, NOISE, seed=2)


def unexplained() -> SimulatedRecording:
    """A reading that waves along the position."""
    bench = Bench.from_device("phantom")
    travel = float(np.std(simulate(bench, NOISE, seed=3).position))
    wave = EccentricEncoder(0.03 * travel, 0.7 * travel)
    return simulate(bench.with_effect(wave), NOISE, seed=3)


def refused() -> SimulatedRecording:
    """A controller follows a trajectory of a few tones."""
    bench = Bench.from_device("phantom")

    def controller(step: int, position: float) -> float:
        time = step * bench.period_s
        wanted = 0.1 * np.sin(2 * np.pi * 0.7 * time) + 0.05 * np.sin(2 * np.pi * 3.1 * time)
        return 2.0 * float(wanted - position)

    return run_loop(bench, controller, SECONDS, seed=4)


REPORTS: dict[str, Callable[[], SimulatedRecording]] = {
    made.__name__: made for made in (clean, explained, unexplained, refused)
}


def report(name: str, folder: Path) -> Path:
    """Record, analyse, and keep the page alone."""
    made = REPORTS[name]()
    recording = bh.recording_from_arrays(
        **made.signals,
        name=name,
        encoder_resolution=Bench.from_device("phantom").encoder_resolution,
    )
    closed = bh.close_loop(recording, "free", device="phantom", seed=1)
    with tempfile.TemporaryDirectory() as place:
        page = bh.write_report(closed, Path(place) / name)
        shutil.copyfile(page, folder / f"{name}.html")
    return folder / f"{name}.html"


def main() -> None:
    """Make all of them, or those named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=(*REPORTS, []), help="all by default")
    parser.add_argument("-o", "--output", type=Path, default=FOLDER)
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    for name in given.names or REPORTS:
        print(report(name, given.output), flush=True)


if __name__ == "__main__":
    one_thread_from_the_start()
    main()
