"""What the rules of acceptance cost and find: each of them left out, and what then changes.

    python -m benchmarks.acceptance --clean 24 --each 2
    python -m benchmarks.acceptance --reach --each 8 --seconds 20

Of every recording all candidates of all classes are fitted, whether or not a test raises them: so a
clean recording shows what acceptance alone would let through.  Then the first round is decided with
all rules, and with one of them left out at a time.  The table is that of docs/statistics.md.
With --reach, of linear effects: what share of the best candidate's gain after a few steps the right
one has, and how much of the work other shares than `thresholds.REACH` would save.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bayeshaptic.diagnosis import acceptance, thresholds
from bayeshaptic.diagnosis.loop import trials_for
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import FIT, Trial, compared_errors, share, worth
from bayeshaptic.diagnosis.trials.linear import sieve
from bayeshaptic.inference.screening import starting_bases
from bayeshaptic.numerics.spending import BUDGET_S, RATE, metered
from benchmarks.base_fits import Job, begun_of
from benchmarks.recordings.blind import CASES, LISTED, SINGLE, cases_for

LEFT_OUT = {
    "ENOUGH": -np.inf,
    "SHARE": 0.0,
    "A_PARAMETER": 0.0,
    "WORSE": np.inf,
    "RIVAL": 1.0,
    "LEAST": 1.0,
    "LAW_REST": 0.0,
    "TIE": 0.0,
    "LAW_TIE": 0.0,
    "MENDED": 1.0,
}
"""Every rule, and the value with which it decides nothing."""


@dataclass(frozen=True)
class Decided:
    """The first round: what was accepted (with what ties), and the verdict on what it leaves."""

    name: str
    ties: tuple[str, ...]
    verdict: str


def decided(job: Job) -> dict[str, Decided]:
    """The first round of one recording with all rules (""), and with each of them left out."""
    begun = begun_of(job)
    kind = trials_for(begun.etfe, begun.fit)
    before = kind.tests(kind.first)
    raised = tuple(replace(test, threshold=-np.inf) for test in before)
    with metered(10 * BUDGET_S * RATE) as meter:
        trials = kind.trials(kind.first, raised, meter)

    @cache
    def tests_of(number: int) -> tuple[Test, ...]:
        return kind.tests(trials[number].state)

    errors_of = [compared_errors(kind.first, trial.state) for trial in trials]

    def left(trial: Trial) -> tuple[Test, ...]:
        tests = tests_of(next(i for i, one in enumerate(trials) if one is trial))
        return acceptance.remaining(tests, trial.state.accepted)

    def first_round() -> Decided:
        open_ = [
            trial
            for trial, errors in zip(trials, errors_of, strict=True)
            if trial.convincing and not any(map(acceptance.raises_error, *errors))
        ]
        chosen = acceptance.choose(
            open_,
            lambda trial: acceptance.excess(left(trial)),
            lambda trial: worth(trial.state.fit),
        )
        if chosen is None:
            return Decided("", (), acceptance.verdict_of((), before)[0])
        ties = acceptance.with_ties(chosen, open_).accepted[-1].ties
        verdict, _ = acceptance.verdict_of(chosen.state.accepted, left(chosen))
        return Decided(chosen.name, ties, verdict)

    found = {"": first_round()}
    for rule, value in LEFT_OUT.items():
        with left_out(rule, value):
            found[rule] = first_round()
    return found


@contextmanager
def left_out(rule: str, value: float) -> Iterator[None]:
    """Decide without one rule."""
    usual = getattr(thresholds, rule)
    setattr(thresholds, rule, value)
    try:
        yield
    finally:
        setattr(thresholds, rule, usual)


def jobs(clean: int, each: int, seconds: float, seed: int) -> list[Job]:
    """Clean recordings, and `each` of every effect but those of single samples, where it shows."""
    ways = [(case, seconds, with_file) for with_file in (True, False) for case in CASES]
    made = [Job(*ways[i % len(ways)], seed + i) for i in range(clean)]
    for effect, (family, _) in list(SINGLE.items())[: LISTED + 5]:
        able = [way for way in ways if way[0] in cases_for(effect)]
        if family != "measurement":
            made += [
                Job(*able[(len(made) + 3 * i) % len(able)], seed + 1000 + len(made), effect)
                for i in range(each)
            ]
    return made


def reached(job: Job) -> tuple[float, list[float]]:
    """Gain of the right candidate after a few steps, and of all, as shares of the best one's."""
    begun = begun_of(job)
    fit, etfe = begun.fit, begun.etfe
    windows = fit.windows.part(share(fit.windows, FIT))
    found = sieve(fit.model, etfe, windows, starting_bases(fit.model, fit.theta, fit.elsewhere))
    shares = [one.gain / found[0].gain for one in found]
    right = [s for s, one in zip(shares, found, strict=True) if one.effect.name in named(job)]
    return max(right, default=0.0), shares


def named(job: Job) -> set[str]:
    """Names of the library that are right for the effect of a recording."""
    return set(SINGLE[job.effect][1])


def reach_table(found: list[tuple[Job, tuple[float, list[float]]]]) -> str:
    """A row a share: how many of the right candidates are followed, and of all."""
    lines = ["| followed from | right ones followed | of all candidates |", "| --- | --- | --- |"]
    every = [share for _, (_, shares) in found for share in shares]
    for least in (0.05, 0.1, 0.2, 0.3, 0.5, 0.7):
        right = sum(own >= least for _, (own, _) in found)
        lines.append(
            f"| {least} | {right} of {len(found)} | {np.mean(np.array(every) >= least):.0%} |"
        )
    return "\n".join(lines)


def table(found: list[tuple[Job, dict[str, Decided]]]) -> str:
    """A row a rule: what changes where it is left out."""
    clean = [rounds for job, rounds in found if not job.effect]
    others = [(SINGLE[job.effect][1], rounds) for job, rounds in found if job.effect]
    lines = [
        f"| left out | value | {len(clean)} clean: something accepted "
        f"| {len(others)} with an effect: named | named or tied | explained after one round |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for rule in ("", *LEFT_OUT):
        named = [rounds[rule].name in right for right, rounds in others]
        tied = [bool({rounds[rule].name, *rounds[rule].ties} & right) for right, rounds in others]
        explained = [rounds[rule].verdict == "explained" for _, rounds in others]
        value = getattr(thresholds, rule) if rule else ""
        lines.append(
            f"| {rule or 'none'} | {value} | {sum(r[rule].name != '' for r in clean)} "
            f"| {sum(named)} | {sum(tied)} | {sum(explained)} |"
        )
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--clean", type=int, default=24, help="clean recordings")
    parser.add_argument("--each", type=int, default=2, help="recordings of each effect")
    parser.add_argument("--seconds", type=float, default=30.0, help="of each recording")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=40_000)
    parser.add_argument("--reach", action="store_true", help="of linear effects, what is followed")
    asked = parser.parse_args()
    todo = jobs(0 if asked.reach else asked.clean, asked.each, asked.seconds, asked.seed)
    found = []
    with ProcessPoolExecutor(asked.workers) as pool:
        if asked.reach:
            linear = [job for job in todo if SINGLE[job.effect][0] == "linear"]
            shares = list(zip(linear, pool.map(reached, linear), strict=True))
            for job, (own, _) in shares:
                print(job, f"{own:.2f}", file=sys.stderr)
            print(reach_table(shares))
            return
        for job, rounds in zip(todo, pool.map(decided, todo), strict=True):
            found.append((job, rounds))
            print(job, rounds[""], file=sys.stderr, flush=True)
    print(table(found))


if __name__ == "__main__":
    main()
