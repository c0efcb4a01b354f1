"""Gravity on a part that turns, and a constant force: the bench's, and the loop's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces import called_for as tried
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.effects.library import effect_class
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate

PHANTOM = Bench.from_device("phantom")


def test_the_bench_swings_like_a_pendulum_and_falls_like_a_stone() -> None:
    """Against an integrator of another library; the constant force moves m x'' + b x' = F."""
    values = {"m": 0.002, "b": 0.001}
    plain = replace(PHANTOM, mechanism="rigid", values=values, delay_s=0.0).quiet()
    solution = solve_ivp(
        lambda t, y: [y[1], (-0.001 * y[1] - 0.04 * np.sin(y[0] - 0.3)) / 0.002],
        (0, 0.999),
        [1.5, 0.0],
        rtol=1e-11,
        atol=1e-13,
        t_eval=np.arange(1000) * 1e-3,
    )
    swung = plain.with_effect("gravity", torque=0.04, hangs_at=0.3)
    found = simulate(swung, np.zeros(1000), start={"m1": (1.5, 0.0)}).position
    assert np.abs(found - solution.y[0]).max() < 1e-3
    pushed = simulate(plain.with_effect("constant_force", force=0.01), np.zeros(1000)).position
    t = np.arange(1000) * 1e-3
    expected = 10.0 * (t + 2.0 * np.expm1(-t / 2.0))
    assert np.abs(pushed - expected).max() < 1e-3 * expected[-1]


def test_gravity_is_named_and_sized(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = [effect_class(name) for name in ("gravity", "hardening_spring")]
    monkeypatch.setattr(tried, "effects", lambda family: kinds)
    bench = PHANTOM.with_effect("gravity", torque=0.04, hangs_at=0.6)
    made = simulate(bench, WhiteNoise(3 * bench.force_rms, 300.0, 0.3, 10.0), seed=1)
    recording = recording_from_arrays(**made.signals)
    etfe = estimate_etfe(recording)
    state = State(etfe, least_squares(build_model("free", "phantom"), etfe))
    best = max(nonlinear_trials(state, {"x^3"}, Meter()), key=lambda trial: trial.score)
    assert best.name == "gravity"
    assert best.accepted.estimates["gravity_torque"].mean == pytest.approx(0.04, rel=0.02)
    assert best.accepted.estimates["hangs_at"].mean == pytest.approx(0.6, abs=0.02)
    assert best.state.fit.reduced_chi_square < 1.3
