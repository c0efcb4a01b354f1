"""Does the limit hold where effects hide that no test can see?

    python -m benchmarks.hidden [--recordings 400] [--seed 1] [--pairs] [--file with|without]
        [--processes 2] [--keep FOLDER]

Recordings of both devices, free and held, 10 and 30 s long, half of them without a device file,
with effects drawn at random (`recordings/hidden.py`).  Printed beside the figures of the average
those of the declared model on the same recordings: how often K_CR's 90 % interval holds the truth,
and how often the truth lies below the stiffness of a risk.  Recordings whose report recommends no
stiffness are left out and counted.

With --keep the closed loops stay in a folder: a run that was stopped goes on, and one after a
change of the average alone takes a tenth of the time.
"""

from __future__ import annotations

import argparse
import os
import pickle
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

from bayeshaptic.diagnosis.analysis import Analysis  # noqa: E402
from bayeshaptic.diagnosis.close_loop import close_loop, with_average  # noqa: E402
from bayeshaptic.diagnosis.closed import Closed  # noqa: E402
from bayeshaptic.diagnosis.hidden.average import Average  # noqa: E402
from bayeshaptic.diagnosis.hidden.prior import HiddenPrior  # noqa: E402
from bayeshaptic.diagnosis.hidden.weighed import Weighed  # noqa: E402
from bayeshaptic.diagnosis.options import Options  # noqa: E402
from bayeshaptic.report.headline import headline  # noqa: E402
from bayeshaptic.rig import Bench  # noqa: E402
from benchmarks.recordings.hidden import (  # noqa: E402
    CASES,
    LENGTHS_S,
    NONE,
    Job,
    bench_of,
    clean_bench,
    jobs,
    possible,
    recorded,
    seen_in,
)

LEVELS = (0.01, 0.05, 0.5, 0.95)
SENSITIVE = (0.5, 2.0)


@dataclass(frozen=True)
class Outcome:
    """One recording.

    Attributes
    ----------
    job : Job
    verdict : str
    stated : bool
        Whether the report recommends a stiffness.
    truth : float
        K_CR, dB.
    declared, average, less, more, oracle : tuple of float
        Points of K_CR at `LEVELS`, dB: of the declared model, of the average, of the average with
        prior probabilities halved and doubled, and of whoever knows the mixture of this benchmark.
    probability : float
        Of the effect that is there.
    seconds, hidden_seconds : float
        Processor time of the closed loop, and of the average.
    """

    job: Job
    verdict: str
    stated: bool
    truth: float
    declared: tuple[float, ...]
    average: tuple[float, ...]
    less: tuple[float, ...]
    more: tuple[float, ...]
    oracle: tuple[float, ...]
    probability: float
    seconds: float
    hidden_seconds: float


@cache
def seen(case: str, length: float) -> dict[str, Callable[[float], float]]:
    """What the tests see; once for each process."""
    return seen_in(case, length)


def closed_of(job: Job, bench: Bench) -> tuple[Closed, float]:
    """The closed loop without the average, and its processor time."""
    device, held = CASES[job.case]
    told = {"device": device} if job.file else {"delay_s": bench.delay_s, "delay_sd_s": 0.0}
    recording = recorded(bench, job.seconds, job.seed)
    began = time.process_time()
    model = "grasped" if held else "free"
    closed = close_loop(recording, model, seed=job.seed, hidden=False, **told)
    return closed, time.process_time() - began


def run(job: Job, keep: Path | None) -> Outcome:
    """Simulate, close the loop, average, compare."""
    warnings.simplefilter("ignore")
    kept = keep / f"{job.seed}.pickle" if keep else None
    if kept and kept.exists():
        bench, closed, took = pickle.loads(kept.read_bytes())
    else:
        clean = clean_bench(job.case)
        bench = clean if job.effect == NONE else bench_of(job, seen(job.case, job.seconds))
        closed, took = closed_of(job, bench)
        if kept:
            part = kept.with_suffix(".part")
            part.write_bytes(pickle.dumps((bench, closed, took)))
            part.replace(kept)
    began = time.process_time()
    closed = with_average(closed, HiddenPrior(), Options(seed=job.seed))
    averaging = time.process_time() - began
    analysis, hidden = closed.analysis, closed.analysis.hidden
    there = [e for e in hidden.effects if e.name == job.effect] if hidden else []
    average = tuple(analysis.limit.db(LEVELS))
    other = [_db(hidden.sensitivity[f]) if hidden else average for f in SENSITIVE]
    return Outcome(
        job,
        closed.verdict,
        headline(closed).status != "untrusted",
        float(20 * np.log10(bench.true_critical_stiffness())),
        tuple(analysis.declared.db(LEVELS)),
        average,
        *other,
        oracle(analysis, possible(job.case)) if hidden else average,
        there[0].probability if there else 0.0,
        took + averaging,
        averaging,
    )


def oracle(analysis: Analysis, effects: Sequence[str]) -> tuple[float, ...]:
    """Points of K_CR, dB, where nothing has a probability of a third, else one of `effects`."""
    hidden = analysis.hidden
    assert hidden is not None
    weighed = hidden.looked.weighed
    names = [next((e for e in effects if e == alias(one)), "") for one in weighed]
    places = [max(names.count(name), 1) for name in names]
    prior = np.array([bool(n) * 2 / len(effects) / p for n, p in zip(names, places, strict=True)])
    evidence = np.array([one.log_evidence for one in weighed])
    odds = prior * np.exp(np.where(np.isfinite(evidence), evidence, -np.inf))
    whole = 1 + odds.sum()
    known = Average(hidden.looked, 1 / whole, odds / whole, np.zeros((len(odds), len(odds))))
    limit = analysis.declared
    factors = np.exp(known.log_factors(len(limit.samples), np.random.default_rng(0)))
    return tuple(replace(limit, samples=limit.samples * factors).db(LEVELS))


def alias(one: Weighed) -> str:
    """The name of an effect here: a spring of the connection is an effect of its own."""
    return "hardening_connection" if one.place.startswith("stretch") else one.name


def _db(stiffness: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(float(20 * np.log10(k)) for k in stiffness)


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
    for file in (True, False):
        name = "with" if file else "without"
        lines.append(row(f"  {name} a device file", [o for o in stated if o.job.file == file]))
    clean = [o for o in stated if o.job.effect == NONE]
    for name, points in (
        ("prior halved", "less"),
        ("prior doubled", "more"),
        ("an oracle", "oracle"),
    ):
        lines.append(row(name, [replace(o, average=getattr(o, points)) for o in stated]))
        other = [replace(o, average=getattr(o, points)) for o in clean]
        lines.append(row("  nothing hides", other))
    shares = np.array([o.hidden_seconds / (o.seconds - o.hidden_seconds) for o in outcomes])
    whole = np.array([[o.hidden_seconds, o.seconds] for o in outcomes]).sum(axis=0)
    lines.append(
        f"the average adds {whole[0] / (whole[1] - whole[0]):.0%} to the processor time of the "
        f"closed loops (single ones: median {np.median(shares):.0%}, most {shares.max():.0%})"
    )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--recordings", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--pairs", action="store_true", help="two effects in every recording")
    parser.add_argument("--file", choices=("with", "without"), help="only these of the recordings")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--keep", type=Path, help="folder for closed loops and outcomes")
    asked = parser.parse_args()
    keep = asked.keep and asked.keep / str(asked.seed)
    if keep:
        keep.mkdir(parents=True, exist_ok=True)
    outcomes = []
    with ProcessPoolExecutor(asked.processes) as pool:
        drawn = jobs(asked.recordings, asked.seed, asked.pairs)
        drawn = [job for job in drawn if asked.file in (None, "with" if job.file else "without")]
        for number, outcome in enumerate(pool.map(partial(run, keep=keep), drawn), 1):
            outcomes.append(outcome)
            print(f"{number} {outcome.job.case} {outcome.job.effect}", end="\r", flush=True)
    if keep:
        (keep / "outcomes.pickle").write_bytes(pickle.dumps(outcomes))
    print(table(outcomes))


if __name__ == "__main__":
    main()
