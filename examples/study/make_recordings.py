"""Make the recordings of the example study: python examples/study/make_recordings.py

They come from the virtual bench: a PHANToM as in Table I of Diaz and Gil (2010), alone and in the
hands of six people, with its arm more or less stretched out. `--table` prints the truth, which
README.md holds.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayeshaptic.rig import Bench, WhiteNoise, critical_limit, simulate, write_recording

FOLDER = Path(__file__).parent / "recordings"
SECONDS = 12.0
SEED = 1  # of the people
HAND = ("bs", "ks", "mh", "bh", "kh")
GRIP = ("b1", "m2")  # what fingers add to the device itself: damping at the motor, mass at the link
HAND_SD, GRIP_SD = 0.35, 0.25  # of the logarithms over people
USERS = ("anna", "ben", "carla", "david", "emma", "farid")
FREE_AT = (0.0, 0.3, 0.6, 1.0)  # how far the arm is stretched out
HELD_AT = 0.5
ALSO_AT = {"anna": 0.0, "ben": 1.0}  # who was recorded a second time, and where


@dataclass(frozen=True)
class Entry:
    """A recording: the bench is the truth."""

    name: str
    bench: Bench
    stretched: float
    seed: int

    @property
    def path(self) -> Path:
        return FOLDER / f"{self.name}.csv.gz"


def stretched(bench: Bench, share: float) -> Bench:
    """The bench with its arm stretched out by a share of its way.

    The masses get a longer lever, the transmission is softer and drags less; half-way is Table I.
    """
    values = dict(bench.values)
    for name in ("m1", "m2"):
        values[name] *= 0.8 + 0.4 * share
    values["kc"] *= 1.1 - 0.2 * share
    values["b1"] *= 1.25 - 0.5 * share
    return replace(bench, values=values)


def people(count: int = len(USERS), seed: int = SEED) -> list[dict[str, float]]:
    """Factors on Table I's hand, and on what a grip adds to the device, for each person."""
    rng = np.random.default_rng(seed)
    sd = np.array([HAND_SD] * len(HAND) + [GRIP_SD] * len(GRIP))
    factors = np.exp(sd * rng.standard_normal((count, len(sd))))
    return [dict(zip((*HAND, *GRIP), row, strict=True)) for row in factors.tolist()]


def held_by(user: str) -> Bench:
    """The bench in a person's hand, the arm half-way."""
    bench = Bench.from_device("phantom", held=True)
    factors = people()[USERS.index(user)]
    values = {name: value * factors.get(name, 1.0) for name, value in bench.values.items()}
    return replace(bench, values=values, user=user)


def entries() -> tuple[Entry, ...]:
    """Every recording of the study."""
    nobody = Bench.from_device("phantom")
    found = [(f"free-{100 * at:03.0f}", stretched(nobody, at), at) for at in FREE_AT]
    found += [(user, held_by(user), HELD_AT) for user in USERS]
    found += [(f"{u}-{100 * at:03.0f}", stretched(held_by(u), at), at) for u, at in ALSO_AT.items()]
    return tuple(Entry(*one, seed=2000 + number) for number, one in enumerate(found))


def record(entry: Entry) -> Path:
    """Simulate one experiment, its commands whole steps of 10 uN m, and write it."""
    bench = entry.bench
    excitation = WhiteNoise(0.05 if bench.mechanism == "free" else 0.1, 200.0, 0.7, SECONDS)
    force = excitation.force(0, bench.period_s, np.random.default_rng(entry.seed))
    return write_recording(entry.path, simulate(bench, np.round(force, 5), seed=entry.seed))


def table() -> str:
    """The truth of each recording."""
    lines = ["| file | held by | arm | K_CR | at |", "| --- | --- | --- | --- | --- |"]
    for entry in entries():
        limit = critical_limit(entry.bench)
        lines.append(
            f"| `{entry.path.name}` | {entry.bench.user or 'nobody'} | {entry.stretched:g} "
            f"| {20 * np.log10(limit.stiffness):.2f} dB | {limit.frequency_hz:.2f} Hz |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--table", action="store_true", help="print the truth, write nothing")
    if parser.parse_args().table:
        print(table())
        return
    FOLDER.mkdir(exist_ok=True)
    for entry in entries():
        path = record(entry)
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
