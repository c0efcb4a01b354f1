"""When a sampler gives up, and when a little more is worth its evaluations."""

from __future__ import annotations

import numpy as np
import pytest

from bayeshaptic.inference.diagnostics import Diagnostics
from bayeshaptic.inference.sampling import run as sampling_run
from bayeshaptic.inference.sampling.ensembles import ENSEMBLES, WALKERS
from bayeshaptic.inference.sampling.stopping import Verdict
from bayeshaptic.progress import silent

STEP = ENSEMBLES * WALKERS  # evaluations
USUAL = 1000 * STEP


class Steps:
    """A run of which the steps alone count."""

    every, more = 1, 100

    def __init__(self) -> None:
        self.steps = 0
        self.chains = np.empty(0)

    def advance(self) -> None:
        self.steps += self.more

    def go_on(self, verdict: Verdict, affordable: int) -> None:
        self.more = min(100, affordable)


def steps_until_done(wanted: int, known_at: int | None = None) -> tuple[int, bool]:
    """Steps taken where `wanted` are asked for, and whether what was asked for is known then."""
    run, nothing = Steps(), Diagnostics(*[np.empty(0)] * 3)

    def rule(chains: np.ndarray) -> Verdict:
        known = run.steps >= (known_at or wanted)
        return Verdict(nothing, known, run.steps >= wanted, run.steps / wanted, "", "")

    def left(times: float) -> int:
        return int(times * USUAL) - run.steps * STEP

    verdict = sampling_run.run_until_done(run, rule, left, silent, lambda run: None)
    return run.steps, verdict.known


@pytest.mark.parametrize(
    ("wanted", "steps", "known"),
    [(700, 700, True), (1300, 1300, True), (1900, 1900, True), (2500, 1000, False)],
)
def test_chains_that_lack_little_go_on(wanted: int, steps: int, known: bool) -> None:
    """Two clean knobs in a hand had no limit: an R-hat was 1.011, an error 5.8 % for 5 %."""
    assert steps_until_done(wanted) == (steps, known)


def test_a_small_risk_alone_is_worth_no_more() -> None:
    assert steps_until_done(1900, known_at=900) == (1000, True)
