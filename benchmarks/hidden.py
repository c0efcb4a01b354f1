"""Does the limit hold where effects hide that no test can see?

    python benchmarks/hidden.py [--recordings 400] [--seed 1] [--processes 2] [--without-device]
        [--keep FILE]

Recordings of both devices, free and held, 10 and 30 s long, with effects drawn at random
(`hidden_recordings.py`).  Printed beside the figures of the average those of the declared model on
the same recordings: how often K_CR's 90 % interval holds the truth, and how often the truth lies
below the stiffness of a risk.  Recordings whose report recommends no stiffness are left out and
counted.
"""

from __future__ import annotations

import argparse
import os
import pickle
import time
import warnings
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402
from hidden_recordings import (  # noqa: E402
    CASES,
    LENGTHS_S,
    NONE,
    Job,
    bench_of,
    clean_bench,
    jobs,
    recording_of,
    seen_in,
)

from bayeshaptic.diagnosis.closed import close_loop  # noqa: E402
from bayeshaptic.report.headline import headline  # noqa: E402

LEVELS = (0.01, 0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Outcome:
    """One recording: `declared` and `average` are the points of K_CR at `LEVELS`, dB."""

    job: Job
    verdict: str
    stated: bool
    truth: float
    declared: tuple[float, ...]
    average: tuple[float, ...]
    probability: float
    seconds: float
    hidden_seconds: float


@cache
def seen(case: str, length: float) -> dict[str, Callable[[float], float]]:
    """What the tests see; once for each process."""
    return seen_in(case, length)


def run(job: Job, with_device: bool) -> Outcome:
    """Simulate, close the loop, compare."""
    warnings.simplefilter("ignore")
    device, held = CASES[job.case]
    clean = clean_bench(job.case)
    bench = clean if job.effect == NONE else bench_of(job, seen(job.case, job.seconds))
    told = {"device": device} if with_device else {"delay_s": bench.delay_s, "delay_sd_s": 0.0}
    recording = recording_of(bench, job.seconds, job.seed)
    began = time.process_time()
    closed = close_loop(recording, "grasped" if held else "free", seed=job.seed, **told)
    took = time.process_time() - began
    analysis = closed.analysis
    there = [e for e in analysis.hidden.effects if e.name == job.effect] if analysis.hidden else []
    return Outcome(
        job,
        closed.verdict,
        headline(closed).status != "untrusted",
        float(20 * np.log10(bench.true_critical_stiffness())),
        tuple(analysis.declared.db(LEVELS)),
        tuple(analysis.limit.db(LEVELS)),
        there[0].probability if there else 0.0,
        took,
        analysis.seconds.get("what could hide", 0.0),
    )


def row(name: str, outcomes: list[Outcome]) -> str:
    """One line of the table."""
    if not outcomes:
        return f"{name:28s}    0"
    truth = np.array([o.truth for o in outcomes])
    cells = []
    for points in ([o.declared for o in outcomes], [o.average for o in outcomes]):
        low1, low, _, high = np.array(points).T
        covered = np.mean((low <= truth) & (truth <= high))
        cells.append(
            f"{covered:7.1%} {np.mean(truth < low1):6.1%} {np.mean(truth < low):6.1%} "
            f"{np.median(high - low):8.4f}"
        )
    return f"{name:28s} {len(outcomes):4d}   {'   '.join(cells)}"


def table(outcomes: list[Outcome]) -> str:
    """By strength, verdict, effect and device."""
    stated = [o for o in outcomes if o.stated]
    one = [o for o in stated if o.job.effect != NONE]
    thirds = np.geomspace(1 / 30, 3.0, 4)
    lines = [
        f"{len(outcomes) - len(stated)} of {len(outcomes)} recommend no stiffness",
        f"{'':35s} declared: 90 %  <1 %   <5 %  width dB   average: 90 %  <1 %   <5 %  width dB",
        row("all", stated),
        row("nothing hides", [o for o in stated if o.job.effect == NONE]),
    ]
    for low, high in zip(thirds[:-1], thirds[1:], strict=True):
        part = [o for o in one if low <= o.job.share <= high]
        lines.append(row(f"strength {low:.2f} to {high:.2f} of seen", part))
    seen_not = [o for o in one if o.verdict == "consistent"]
    lines.append(row("one effect, consistent", seen_not))
    for name in dict.fromkeys(o.job.effect for o in one):
        lines.append(row(f"  {name}", [o for o in one if o.job.effect == name]))
    for name in CASES:
        lines.append(row(f"  {name}", [o for o in stated if o.job.case == name]))
    for length in LENGTHS_S:
        lines.append(row(f"  {length:g} s", [o for o in stated if o.job.seconds == length]))
    spent = np.array([[o.hidden_seconds, o.seconds] for o in outcomes]).sum(axis=0)
    lines.append(f"what could hide took {spent[0] / spent[1]:.0%} of the analysis")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--recordings", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--without-device", action="store_true", help="the analysis has no file")
    parser.add_argument("--keep", help="file for the outcomes (pickle), to look at them closer")
    asked = parser.parse_args()
    work = partial(run, with_device=not asked.without_device)
    outcomes = []
    with ProcessPoolExecutor(asked.processes) as pool:
        for number, outcome in enumerate(pool.map(work, jobs(asked.recordings, asked.seed)), 1):
            outcomes.append(outcome)
            print(f"{number} {outcome.job.case} {outcome.job.effect}", end="\r", flush=True)
    if asked.keep:
        with open(asked.keep, "wb") as file:
            pickle.dump(outcomes, file)
    print(table(outcomes))


if __name__ == "__main__":
    main()
