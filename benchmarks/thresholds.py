"""What the tests of the residual cost and find: false alarms on clean recordings, and power.

    python -m benchmarks.thresholds --clean 400 --power 10 --workers 2

A clean recording is the virtual bench's, without any effect: both devices, free and held, of three
lengths, analysed with and without a device file.  Only a fit is needed, no sampling.  The table is
that of docs/statistics.md; the last line is the share of recordings with any false alarm.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from bayeshaptic.diagnosis.battery import residual_tests
from benchmarks.base_fits import Job, begun_of
from benchmarks.recordings.blind import CASES, LISTED, SINGLE, cases_for

SECONDS = (10.0, 30.0, 90.0)


Found = dict[str, tuple[str, float, float]]
"""Name of a test to its family, statistic and threshold."""


def tested(job: Job) -> tuple[Job, Found]:
    """Every test of one recording."""
    begun = begun_of(job)
    tests = residual_tests(begun.fit, begun.etfe)
    return job, {t.name: (t.family, float(t.statistic), float(t.threshold)) for t in tests}


def clean_jobs(count: int, seed: int) -> list[Job]:
    """`count` recordings dealt out over devices, lengths, and with and without a file."""
    ways = [(c, s, f) for s in SECONDS for c in CASES for f in (True, False)]
    return [Job(*ways[i % len(ways)], seed=seed + i) for i in range(count)]


def power_jobs(each: int, seed: int) -> list[Job]:
    """`each` recordings of 30 s of every effect that the library promises, where it shows."""
    jobs = []
    for number, effect in enumerate(list(SINGLE)[:LISTED]):
        cases = cases_for(effect)
        for i in range(each):
            ways = (cases[i % len(cases)], 30.0, i // len(cases) % 2 == 0)
            jobs.append(Job(*ways, seed=seed + 1000 * (number + 1) + i, effect=effect))
    return jobs


def run(jobs: Iterable[Job], workers: int) -> list[tuple[Job, Found]]:
    """All jobs, in their order; a dot a recording."""
    done = []
    with ProcessPoolExecutor(workers) as pool:
        for result in pool.map(tested, jobs):
            done.append(result)
            print(".", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    return done


def table(clean: list[tuple[Job, Found]], power: list[tuple[Job, Found]]) -> str:
    """A row a test: threshold, false alarms, the worst clean statistic, recordings found."""
    names = dict.fromkeys(name for _, found in clean for name in found)
    lines = [
        "| test | threshold | clean: flagged | clean: largest statistic | effects it flags |",
        "| --- | --- | --- | --- | --- |",
    ]
    for name in names:
        own = [found[name] for _, found in clean if name in found]
        flagged = sum(s > t for _, s, t in own)
        largest = max(s for _, s, _ in own)
        lines.append(
            f"| {name} | {own[0][2]:.3g} | {flagged} of {len(own)} | {largest:.2f} "
            f"| {_found_by(name, power)} |"
        )
    return "\n".join(lines)


def _found_by(name: str, power: list[tuple[Job, Found]]) -> str:
    parts = []
    for effect in dict.fromkeys(job.effect for job, _ in power):
        own = [found[name] for job, found in power if job.effect == effect and name in found]
        share = float(np.mean([s > t for _, s, t in own])) if own else 0.0
        if share >= 0.5:
            parts.append(f"{effect.replace('_', ' ')} {100 * share:.0f} %")
    return ", ".join(parts)


def false_alarms(clean: list[tuple[Job, Found]]) -> list[str]:
    """The share of recordings with any false alarm, in all and by group."""
    groups = {
        "all": lambda job: True,
        "with a device file": lambda job: job.with_file,
        "without": lambda job: not job.with_file,
        "free": lambda job: not CASES[job.case][1],
        "held": lambda job: CASES[job.case][1],
        **{f"{s:g} s": lambda job, s=s: job.seconds == s for s in SECONDS},
    }
    lines = []
    for title, belongs in groups.items():
        own = [any(s > t for _, s, t in found.values()) for job, found in clean if belongs(job)]
        lines.append(f"{title}: {sum(own)} of {len(own)} clean recordings flagged")
    return lines


def missed(power: list[tuple[Job, Found]]) -> list[str]:
    """Of each effect, the share of recordings in which any test is flagged."""
    lines = []
    for effect in dict.fromkeys(job.effect for job, _ in power):
        own = [
            any(s > t for _, s, t in found.values()) for job, found in power if job.effect == effect
        ]
        lines.append(f"{effect}: {sum(own)} of {len(own)} flagged")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--clean", type=int, default=400, help="clean recordings")
    parser.add_argument("--power", type=int, default=8, help="recordings of each effect")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=20_000)
    options = parser.parse_args()
    clean = run(clean_jobs(options.clean, options.seed), options.workers)
    power = run(power_jobs(options.power, options.seed), options.workers)
    print(table(clean, power), *false_alarms(clean), *missed(power), sep="\n")
    for job, found in clean:
        for name, (_, statistic, threshold) in found.items():
            if statistic > threshold:
                print(f"flagged: {job}: {name} {statistic:.2f}")


if __name__ == "__main__":
    main()
