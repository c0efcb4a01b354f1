"""Is a force seen in a motion that repeats, and how strong may one be that is not?"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.diagnosis.hidden.forces import force_suspects
from bayeshaptic.diagnosis.periodic.force_tests import force_tests
from bayeshaptic.diagnosis.periodic.lines import LineTrials
from bayeshaptic.diagnosis.residuals.residual import Test as ResidualTest
from bayeshaptic.diagnosis.trials.beside import beside_tests
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.rig import Bench, Multisine, simulate

FORCE_RMS_N = 0.02


@cache
def looked_at(held: bool, share: float, seed: int) -> tuple[LineTrials, dict[str, ResidualTest]]:
    """A PHANToM-like device that rubs with a share of the force's rms, and the tests of its fit."""
    bench = Bench.from_device("phantom", held=held)
    if share:
        bench = bench.with_effect("coulomb_friction", force=share * FORCE_RMS_N)
    made = simulate(bench, Multisine(FORCE_RMS_N, 1.0, 120.0, 0.5, 6, phase="random"), seed=seed)
    etfe = bh.estimate_etfe(bh.recording_from_arrays(**made.signals))
    fit = bh.least_squares(build_model("grasped" if held else "free", "phantom"), etfe)
    kind = LineTrials(etfe, fit)
    return kind, {test.name: test for test in force_tests(fit, etfe, kind.period)}


@pytest.mark.parametrize("held", [False, True])
def test_where_nothing_is_scores_are_no_larger_than_chance_makes_them(held: bool) -> None:
    """Weights of few degrees of freedom are the noise's at most: the scores are a little less."""
    seeds = range(8)
    scores = [t.statistic for s in seeds for t in looked_at(held, 0.0, s)[1].values()]
    assert max(scores) < 4.4
    # Those of one recording go together: eight of one shape are what is independent.
    for name in ("sign(v)", "x^2", "u^3"):
        own = [looked_at(held, 0.0, seed)[1][name].statistic for seed in seeds]
        assert np.sum(np.square(own)) < 26.1  # the 99.9 % point of chi-square of eight


@pytest.mark.parametrize(("held", "share"), [(False, 0.02), (True, 0.05)])
def test_dry_friction_is_seen_and_sized_to_first_order(held: bool, share: float) -> None:
    kind, tests = looked_at(held, share, 3)
    seen = tests["sign(v)"].force
    assert tests["sign(v)"].flagged and seen is not None
    # To noise, and to what the friction itself does to the motion whose sign it goes by.
    force = share * FORCE_RMS_N
    assert seen.strength == pytest.approx(force, abs=3 * seen.sd + 0.05 * force)
    assert any(test.name == "sign(v)" for test in kind.tests(kind.first))


def test_what_is_not_seen_may_hide() -> None:
    """The average over what could hide knows how strong a force may be, here, too."""
    kind, tests = looked_at(False, 0.0, 1)
    every = tuple(tests.values())
    places = {one.place: one for one in force_suspects(kind.first.model, every, (), FORCE_RMS_N)}
    said = places["sign(v)"].tested
    assert said is not None and 0 < said.sd < 0.01 * FORCE_RMS_N


def test_windows_try_no_force_where_what_is_left_repeats() -> None:
    """As that of a sweep may with a ripple taken off, which did not before."""
    state = looked_at(False, 0.1, 3)[0].first
    assert nonlinear_trials(state, {"sign(v)"}, Meter()) == []
    assert beside_tests(state) == ()
