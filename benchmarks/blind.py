"""Closing the loop on recordings it has never seen: names, classes, and the truth of K_CR.

    python -m benchmarks.blind [--each N] [--others N] [--clean N] [--pairs N] [--seed S]
        [--known file|delay|nothing] [--drawn] [--early N]

Recordings come from the virtual bench, which shares no code with the models. The base model is the
device as declared, without the effect. Strengths are the bench's typical ones, fixed by the
device's motion; with --drawn devices, sizes and lengths are random. --known says what the analysis
is told: the device's file; or the model, the delay and the encoder alone; or nothing but the
encoder (then it chooses the model itself). --early N writes each position down N samples before its
command acts, as a logger does that reads it after the next command. Printed for every effect:
"clear", the largest test of the base model's residual over its threshold, in the recording where
that is least (of clean ones: where it is most; an effect is clear from three times that on); how
often the class and the name (or a declared tie that holds it) are right; the error of K_CR's median
in dB; how often its 90 % interval covers the truth before and after the loop is closed; and the
largest error of the effect's own size. Below: what was missed, and recommended stiffnesses above
the truth.
"""

from __future__ import annotations

import argparse
import time
import warnings
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench
from benchmarks.recordings.blind import (
    CASES,
    LISTED,
    PAIR,
    SINGLE,
    SIZES,
    UNKNOWN,
    Job,
    bench_of,
    jobs_for,
    pair_jobs,
    recorded,
    seconds_of,
    single_jobs,
)


@dataclass(frozen=True)
class Outcome:
    """What the loop made of one recording."""

    job: Job
    verdict: str
    found: tuple[str, ...]
    ties: tuple[str, ...]
    families: tuple[str, ...]
    residual_class: str | None
    error_db: float
    before_covers: bool
    after_covers: bool
    before_db: float
    held_out: float
    seconds: float
    clear: float
    size_error: float | None
    stiffness: float | None


def run(job: Job, known: str, early: int = 0) -> Outcome:
    """Simulate, close the loop, compare."""
    warnings.simplefilter("ignore")
    device, held = CASES[job.case]
    bench = bench_of(job)
    recording = recorded(bench, seconds_of(job), job.seed)
    if early:
        recording = replace(
            recording, force=recording.force[:-early], position=recording.position[early:]
        )
    truth = bench.true_critical_stiffness()
    declared = "grasped" if held else "free"
    told = {
        "file": (declared, Options(device=device)),
        "delay": (declared, Options(delay_s=bench.delay_s)),
        "nothing": ("auto", Options()),
    }
    model, options = told[known]
    began = time.process_time()
    closed = close_loop(recording, model, options, seed=job.seed)
    took = time.process_time() - began
    before, after = (e["critical_stiffness"] for e in (closed.before, closed.after))
    stiffness = headline(closed).stiffness
    return Outcome(
        job,
        closed.verdict,
        tuple(e.name for e in closed.effects),
        tuple(tie for e in closed.effects for tie in e.ties),
        tuple(e.family for e in closed.effects),
        closed.traced.residual_class,
        _db(after["q50"], truth),
        before["q05"] <= truth <= before["q95"],
        after["q05"] <= truth <= after["q95"],
        _db(before["q50"], truth),
        closed.after.get("held_out_weighted_rms", np.nan),  # none where it was taken for a loop
        took,
        max(test.excess for test in closed.traced.before),
        _size_error(bench, closed),
        None if stiffness is None else stiffness / truth,
    )


def _size_error(bench: Bench, closed: Closed) -> float | None:
    """Relative error of the size of the first effect on the bench, where it was named."""
    for effect in bench.effects:
        there, here = SIZES.get(effect.name, ("", ""))
        for found in closed.diagnosis["effects"]:
            if here in found["parameters"]:
                return float(found["parameters"][here]["q50"] / getattr(effect, there) - 1)
    return None


def _db(value: float, truth: float) -> float:
    return float(20 * np.log10(max(value, 1e-12) / truth))


def attempt(job: Job, known: str, early: int) -> Outcome | str:
    """The outcome, or why the recording was refused."""
    try:
        return run(job, known, early)
    except InputError as error:
        return f"  {job.case}, {', '.join(job.effects)}, seed {job.seed}: refused: {error}"


def main() -> None:
    """Run everything and print the tables."""
    chosen = _arguments()
    groups = {"clean": jobs_for((), chosen.clean, chosen.seed)}
    for effect in SINGLE if chosen.only is None else chosen.only:
        groups[effect] = single_jobs(effect, chosen.each, chosen.others, chosen.seed)
    groups |= pair_jobs(chosen.pairs, chosen.seed)
    if chosen.drawn:
        groups = {n: [replace(job, drawn=True) for job in jobs] for n, jobs in groups.items()}
    print(
        f"{'effect':36s} {'n':>3s} {'clear':>6s} {'class':>6s} {'name':>6s} {'expl.':>6s} "
        f"{'K dB, worst':>12s} {'covers before':>14s} {'after':>6s} {'held-out':>9s} {'size':>7s} "
        f"{'CPU s':>6s}"
    )
    refused: list[str] = []
    sums: dict[str, list[Outcome]] = {"listed": [], "others": [], "pairs": []}
    with ProcessPoolExecutor(chosen.workers) as pool:
        flat = [job for jobs in groups.values() for job in jobs]
        tell = partial(attempt, known=chosen.known, early=chosen.early)
        results = iter(pool.map(tell, flat))  # rows are printed as their recordings are done
        for name, jobs in groups.items():
            answers = [next(results) for _ in jobs]
            refused += [answer for answer in answers if isinstance(answer, str)]
            outcomes = [answer for answer in answers if isinstance(answer, Outcome)]
            print(_row(name, outcomes), flush=True)
            if name != "clean":
                sums[_kind(name)] += outcomes
    for name, outcomes in sums.items():
        print(_row(f"all {name}", outcomes))
    every = [outcome for outcomes in sums.values() for outcome in outcomes]
    print(_row("all but clean", every))
    _print_failures(every, refused)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--each", type=int, default=10, help="recordings of a promised effect")
    parser.add_argument("--others", type=int, default=4, help="of any other effect")
    parser.add_argument("--only", nargs="*", choices=SINGLE, help="these effects alone")
    parser.add_argument("--clean", type=int, default=100)
    parser.add_argument("--pairs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=90_000)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--known", choices=("file", "delay", "nothing"), default="file")
    parser.add_argument("--early", type=int, default=0, help="samples that a position is early")
    parser.add_argument("--drawn", action="store_true", help="random devices, sizes and lengths")
    return parser.parse_args()


def _kind(name: str) -> str:
    if name.startswith(PAIR):
        return "pairs"
    return "listed" if name in list(SINGLE)[:LISTED] else "others"


def _print_failures(every: list[Outcome], refused: list[str]) -> None:
    print(f"refused: {len(refused)}", *refused, sep="\n")
    missed = [o for o in every if not (_class_right(o) and _name_right(o))]
    print(f"class or name missed: {len(missed)} of {len(every)}")
    for o in missed:
        print(
            f"  {_of(o)}: {o.verdict}, {', '.join(o.found) or 'nothing'}, K_CR {o.error_db:+.2f} dB"
        )
    unsafe = [o for o in every if o.error_db > 1.5 and o.verdict != UNKNOWN]
    print(f"median over 1.5 dB too high and not called unexplained: {len(unsafe)} of {len(every)}")
    for o in unsafe:
        print(f"  {_of(o)}: {o.error_db:+.2f} dB")
    stated = [o for o in every if o.stiffness is not None]
    above = [o for o in stated if o.stiffness is not None and o.stiffness > 1]
    print(f"recommended stiffnesses: {len(stated)}, above the truth: {len(above)}")
    for o in above:
        print(f"  {_of(o)}: {o.stiffness:.4f} times")


def _of(outcome: Outcome) -> str:
    job = outcome.job
    return f"{job.case}, {', '.join(job.effects)}, seed {job.seed}"


def _row(name: str, outcomes: list[Outcome]) -> str:
    def share(values: list[bool]) -> str:
        return f"{100 * np.mean(values):.0f} %"

    if not outcomes:
        return f"{name.removeprefix(PAIR):36s} none"
    worst = max((o.error_db for o in outcomes), key=abs)
    sizes = [o.size_error for o in outcomes if o.size_error is not None]
    clear = [o.clear for o in outcomes]
    least = min(clear) if outcomes[0].job.effects else max(clear)
    size = f"{100 * max(sizes, key=abs):+.1f} %" if sizes else ""
    return (
        f"{name.removeprefix(PAIR):36s} {len(outcomes):3d} {least:6.1f} "
        f"{share([_class_right(o) for o in outcomes]):>6s} "
        f"{share([_name_right(o) for o in outcomes]):>6s} "
        f"{share([o.verdict == 'explained' for o in outcomes]):>6s} {worst:+12.2f} "
        f"{share([o.before_covers for o in outcomes]):>14s} "
        f"{share([o.after_covers for o in outcomes]):>6s} "
        f"{np.nanmedian([o.held_out for o in outcomes]):9.2f} {size:>7s} "
        f"{np.median([o.seconds for o in outcomes]):6.1f}"
    )


def _class_right(outcome: Outcome) -> bool:
    if not outcome.job.effects:
        return outcome.verdict == "consistent"
    wanted = {SINGLE[e][0] for e in outcome.job.effects if e in SINGLE}
    seen = set(outcome.families) or {outcome.residual_class}
    return wanted <= seen


def _name_right(outcome: Outcome) -> bool:
    said = set(outcome.found) | set(outcome.ties) | {outcome.verdict} & {UNKNOWN}
    if not outcome.job.effects:
        return not said
    return all(SINGLE[e][1] & said for e in outcome.job.effects)


if __name__ == "__main__":
    main()
