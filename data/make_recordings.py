"""Make the recordings of data/recordings from the virtual bench: python data/make_recordings.py

The truth of each stands in data/README.md, whose table `--table` prints.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayeshaptic.rig import (
    Bench,
    Multisine,
    SimulatedRecording,
    WhiteNoise,
    critical_limit,
    run_relay,
    simulate,
    write_recording,
)

FOLDER = Path(__file__).parent / "recordings"


@dataclass(frozen=True)
class Entry:
    """A recording: the bench is the truth, `make` is the experiment."""

    name: str
    bench: Bench
    experiment: str
    make: Callable[[Bench], SimulatedRecording]

    @property
    def path(self) -> Path:
        return FOLDER / f"{self.name}.csv.gz"


def shaken(excitation: WhiteNoise | Multisine, step: float, seed: int) -> Callable:
    """An experiment from rest, whose commands are whole steps of the amplifier."""

    def make(bench: Bench) -> SimulatedRecording:
        force = excitation.force(0, bench.period_s, np.random.default_rng(seed))
        decimals = round(-np.log10(step))
        return simulate(bench, np.round(force, decimals), seed=seed)

    return make


def relay(amplitude: float, seed: int) -> Callable:
    """A relay experiment of 30 s from rest."""
    return lambda bench: run_relay(bench, amplitude, 30.0, seed=seed)


LHIFAM, LHIFAM_HELD = (Bench.from_device("lhifam", held=held) for held in (False, True))
PHANTOM, PHANTOM_HELD = (Bench.from_device("phantom", held=held) for held in (False, True))
OTHER_HAND = {"bs": 75.0, "ks": 49.0e3, "mh": 1.21, "bh": 22.5, "kh": 181.0}
LHIFAM_B = replace(LHIFAM_HELD, values={**LHIFAM_HELD.values, **OTHER_HAND}, user="B").with_effect(
    "coulomb_friction", force=0.6
)

ENTRIES = (
    Entry(
        "lhifam-free",
        LHIFAM,
        "white noise, 4 N rms, 0.3-300 Hz, 30 s",
        shaken(WhiteNoise(4.0, 300.0, 0.3), 1e-3, seed=101),
    ),
    Entry(
        "lhifam-user",
        LHIFAM_HELD,
        "white noise, 4 N rms, 0.3-300 Hz, 30 s",
        shaken(WhiteNoise(4.0, 300.0, 0.3), 1e-3, seed=102),
    ),
    Entry(
        "lhifam-user-b",
        LHIFAM_B,
        "white noise, 4 N rms, 0.3-300 Hz, 30 s",
        shaken(WhiteNoise(4.0, 300.0, 0.3), 1e-3, seed=103),
    ),
    Entry(
        "phantom-free",
        PHANTOM,
        "white noise, 0.05 N m rms, 0.7-200 Hz, 30 s",
        shaken(WhiteNoise(0.05, 200.0, 0.7), 1e-5, seed=104),
    ),
    Entry(
        "phantom-user",
        PHANTOM_HELD,
        "white noise, 0.1 N m rms, 0.7-200 Hz, 30 s",
        shaken(WhiteNoise(0.1, 200.0, 0.7), 1e-5, seed=105),
    ),
    Entry(
        "phantom-user-multisine",
        PHANTOM_HELD,
        "multisine, 0.1 N m rms, every 0.5 Hz from 1 to 200 Hz, 12 periods of 2 s",
        shaken(Multisine(0.1, 1.0, 200.0, spacing_hz=0.5, periods=12), 1e-5, seed=106),
    ),
    Entry(
        "phantom-user-relay",
        PHANTOM_HELD,
        "relay of 0.3 N m, 30 s, force = -0.3 sign(angle)",
        relay(0.3, seed=107),
    ),
)


def table() -> str:
    """The truth of each recording, as the table in data/README.md."""
    lines = [
        "| file | experiment | mechanism | beyond it | K_CR | at |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for entry in ENTRIES:
        bench, limit = entry.bench, critical_limit(entry.bench)
        unit = "N m/rad" if bench.force_unit == "Nm" else "N/m"
        effects = ", ".join(f"`{effect!r}`" for effect in bench.effects) or "nothing"
        decibel = 20 * np.log10(limit.stiffness)
        lines.append(
            f"| `{entry.path.name}` | {entry.experiment} | {bench.mechanism} | {effects} "
            f"| {limit.stiffness:.6g} {unit} ({decibel:.2f} dB) | {limit.frequency_hz:.2f} Hz |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", action="store_true", help="print the truth, write nothing")
    if parser.parse_args().table:
        print(table())
        return
    FOLDER.mkdir(exist_ok=True)
    for entry in ENTRIES:
        path = write_recording(entry.path, entry.make(entry.bench))
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
