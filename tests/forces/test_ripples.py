"""A force that ripples along the way, by itself or as a share of the command."""

from __future__ import annotations

import numpy as np
import pytest
from along_the_way import DELAY_S, guided
from linear_bench import LHIFAM_HELD, Device, tremor

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.residuals.ripples import ripple_tests
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.report.headline import headline
from benchmarks.strangers.motion import Forces

SECONDS = 20.0
RATE = 2000.0  # radians a metre: the motion of `guided` has an rms of some 4 mm


def analysed(recording: Recording) -> Closed:
    return close_loop(recording, device="lhifam", delay_s=DELAY_S, held=False, hidden=False)


def test_a_gain_that_ripples_is_found_and_the_limit_is_that_of_the_worst_place() -> None:
    """A linear model knows the mean gain: 1.08 times the limit was recommended, in green."""
    ripple = 0.1
    recording, limit = guided(Forces(ripple=ripple, ripples=RATE), SECONDS)
    assert RATE * recording.position.std() > 4
    closed = analysed(recording)
    assert closed.verdict == "explained"
    assert closed.effect_names == ("gain_along_the_way",)
    found = closed.effects[0].estimates
    assert found["ripple"].mean == pytest.approx(ripple, abs=4 * found["ripple"].sd)
    assert 4 * found["ripple"].sd < 0.2 * ripple
    assert found["ripple_period"].mean == pytest.approx(2 * np.pi / RATE, rel=0.02)
    worst = limit / (1 + ripple)
    low, middle, high = closed.analysis.limit.quantile(np.array([0.005, 0.5, 0.995]))
    assert low < worst < high and middle < 0.95 * limit
    said = headline(closed)
    assert said.stiffness is not None and said.stiffness < worst


def test_cogging_is_found_and_taken_off() -> None:
    force = 0.3
    recording, limit = guided(Forces(cogging=force, cogs=RATE), SECONDS)
    closed = analysed(recording)
    assert closed.verdict == "explained"
    assert closed.effect_names == ("cogging",)
    found = closed.effects[0].estimates
    assert found["ripple"].mean == pytest.approx(force, rel=0.1)
    assert found["ripple_period"].mean == pytest.approx(2 * np.pi / RATE, rel=0.02)
    low, high = closed.analysis.limit.quantile(np.array([0.005, 0.995]))
    assert low < limit < high
    said = headline(closed)
    assert said.stiffness is not None and said.stiffness < limit


def test_a_hand_that_moves_the_device_feigns_none() -> None:
    device, model = Device(LHIFAM_HELD), build_model("grasped", "lhifam")
    for seed in range(8):
        rng = np.random.default_rng(seed)
        force = 4.0 * rng.standard_normal(15_000)
        position = device.simulate(force) + device.simulate(2.0 * tremor(rng, 15_000, 1e-3), 2)
        count = 3e-6
        recording = recording_from_arrays(force, count * np.round(position / count), period_s=1e-3)
        etfe = estimate_etfe(recording)
        tests = ripple_tests(least_squares(model, etfe, start=model.values), etfe)
        assert len(tests) == 2
        # Each of 16 is as large as that once in 10^4 by chance.
        assert all(test.statistic < thresholds.LOG_CHANCE - 1 for test in tests)
