"""Explanations that a recording hardly tells apart: each counts by its evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_bench import RIGID, Device

from bayeshaptic.diagnosis.state import Accepted, State, Trial
from bayeshaptic.diagnosis.traced import EXPLAINED, Traced
from bayeshaptic.diagnosis.widening.rivals import with_rivals
from bayeshaptic.effects.library import effect_class
from bayeshaptic.inference import least_squares
from bayeshaptic.inference.fit import Fit
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.stability.mixed import mixed

LATE = 1e-4


@pytest.fixture(scope="module")
def etfe() -> Etfe:
    rng = np.random.default_rng(2)
    force = rng.normal(size=8000)
    position = Device(RIGID, delay=2e-4 + LATE).simulate(force)
    position = position + 1e-5 * position.std() * rng.normal(size=len(position))
    return estimate_etfe(recording_from_arrays(force, position, 1e-3), (1.0, 200.0))


def fit_with(etfe: Etfe, name: str) -> Fit:
    model = build_model("rigid", delay_s=2e-4, period_s=1e-3)
    base = least_squares(model, etfe)
    effect = effect_class(name).candidates(base.model, etfe)[0]
    return least_squares(base.model.with_effect(effect), etfe)


def trial_of(etfe: Etfe, fit: Fit, name: str) -> Trial:
    accepted = Accepted(name, name, "linear", "", ties=(), limit_log_sd=0.3)
    return Trial(accepted, State(etfe, fit, (accepted,)), 0.0, 0.0, 1)


def traced_as(chosen: Trial, *others: Trial) -> Traced:
    return Traced(EXPLAINED, "linear", chosen.state, (), (), rejected=others)


def limit_of(fit: Fit, rng: np.random.Generator) -> CriticalStiffness:
    draws = rng.multivariate_normal(fit.theta, fit.covariance, size=2000)
    return critical_stiffness(fit.model, draws)


def test_one_delay_and_one_lag_share_the_probability(etfe: Etfe) -> None:
    late, lag = (
        trial_of(etfe, fit_with(etfe, name), name) for name in ("extra_delay", "actuator_lag")
    )
    before = limit_of(late.state.fit, np.random.default_rng(0))
    limit, traced = with_rivals(before, traced_as(late, lag))
    (own,) = traced.state.accepted
    (told,) = traced.table({})["effects"]  # as in summary.json
    assert told["probabilities"] == own.probabilities
    assert own.limit_log_sd == 0 and set(own.probabilities) == {"extra_delay", "actuator_lag"}
    # Alike in the band but for what a lag takes off the gain: the likelihoods say how far.
    apart = late.state.fit.log_likelihood - lag.state.fit.log_likelihood
    odds = own.probabilities["extra_delay"] / own.probabilities["actuator_lag"]
    assert np.log(odds) == pytest.approx(apart, abs=0.5)


def test_an_explanation_that_is_its_own_rival_changes_nothing(etfe: Etfe) -> None:
    one = trial_of(etfe, fit_with(etfe, "extra_delay"), "extra_delay")
    before = limit_of(one.state.fit, np.random.default_rng(0))
    other = replace(one, accepted=replace(one.accepted, name="another"))
    limit, traced = with_rivals(before, traced_as(one, other))
    assert traced.state.accepted[0].probabilities == pytest.approx(
        {"extra_delay": 0.5, "another": 0.5}, abs=0.08
    )
    width = np.diff(before.db([0.05, 0.95]))
    assert limit.db([0.05, 0.5, 0.95]) == pytest.approx(
        before.db([0.05, 0.5, 0.95]), abs=0.15 * float(width[0])
    )


def test_what_is_far_behind_and_what_is_no_linear_effect_does_not_count(etfe: Etfe) -> None:
    one = trial_of(etfe, fit_with(etfe, "extra_delay"), "extra_delay")
    nothing = trial_of(etfe, least_squares(build_model("rigid", delay_s=2e-4), etfe), "nothing")
    law = replace(one, accepted=replace(one.accepted, family="nonlinear"))
    before = limit_of(one.state.fit, np.random.default_rng(0))
    limit, traced = with_rivals(before, traced_as(one, nothing, law))
    assert limit is before and not traced.state.accepted[0].probabilities
    assert traced.state.accepted[0].limit_log_sd == 0
    law = replace(law, state=replace(law.state, accepted=(law.accepted,)))
    same, left = with_rivals(before, traced_as(law, one))
    assert same is before and left.rejected == (one,)


def test_a_mixture_has_the_draws_and_the_crossings_of_both(etfe: Etfe) -> None:
    rng = np.random.default_rng(3)
    low = limit_of(fit_with(etfe, "extra_delay"), rng)
    high = replace(
        low,
        samples=2 * low.samples,
        crossings=tuple(replace(c, label="another at 99 Hz") for c in low.crossings),
    )
    both = mixed(low, [high], [0.3], ["another"], rng)
    between = 1.5 * float(np.median(low.samples))
    assert np.mean(both.samples > between) == pytest.approx(0.3, abs=0.001)
    assert [c.label for c in both.crossings][1] == "another at 99 Hz"
    assert [c.probability for c in both.crossings] == pytest.approx([0.7, 0.3], abs=0.001)
    assert np.array_equal(both.group == 1, both.samples > between)
