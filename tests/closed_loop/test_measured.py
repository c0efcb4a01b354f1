"""Periodic motions and inverse dynamics: on simulated devices, and on the measured recordings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from example_script import EXAMPLES, load

import bayeshaptic as bh
from bayeshaptic.diagnosis.battery import is_periodic, periodic_tests
from bayeshaptic.diagnosis.feedback.inverse_dynamics import inverse_dynamics
from bayeshaptic.diagnosis.loop import trace
from bayeshaptic.diagnosis.periodic.balanced_state import BalancedState
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.harmonic_balance import balance
from bayeshaptic.diagnosis.periodic.joint import Basis
from bayeshaptic.diagnosis.periodic.lines import LineTrials
from bayeshaptic.diagnosis.periodic.period import one_period, with_floor
from bayeshaptic.diagnosis.periodic.steady_motion import places_of
from bayeshaptic.diagnosis.state import REPORT, share
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD
from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import compress

Find = Callable[[str], Path]
PERIOD_S = 1e-3
BENCH_COLUMNS = "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]"
WITNESS_COLUMNS = "time=time*1e-6,force=iq_refx[A],position=theta_my*-1[rad]"
SERVO_COLUMNS = "time=t,force=vir*35.15[N],position=qm[m]"
TRUE = {"m1": 0.4, "b1": 0.5, "bc": 0.6, "kc": 2e4, "m2": 0.3, "b2": 0.4}
NOISE = 2e-7


def two_masses(drag: float, seed: int = 0, periods: int = 8) -> Recording:
    """Two masses under a held multisine of 5 to 120 Hz, cubic drag on the body; classical RK4."""
    rng = np.random.default_rng(seed)
    samples, substeps = 1000, 8
    time = np.arange(samples) * PERIOD_S
    lines = np.arange(5, 121)
    phases = -np.pi * np.arange(len(lines)) ** 2 / len(lines)
    force = np.cos(2 * np.pi * lines[:, None] * time + phases[:, None]).sum(axis=0)
    force *= 4 / force.std()
    v = TRUE
    h = PERIOD_S / substeps

    def slope(z: list[float], u: float) -> list[float]:
        x1, x2, v1, v2 = z
        pull = v["kc"] * (x1 - x2) + v["bc"] * (v1 - v2)
        a1 = (u - pull - v["b1"] * v1) / v["m1"]
        a2 = (pull - v["b2"] * v2 - drag * v2**3) / v["m2"]
        return [v1, v2, a1, a2]

    z, position = [0.0, 0.0, 0.0, 0.0], []
    late = np.tile(force, periods + 12).tolist()
    for u in late:
        position.append(z[0])
        for _ in range(substeps):
            k1 = slope(z, u)
            k2 = slope([a + h / 2 * b for a, b in zip(z, k1, strict=True)], u)
            k3 = slope([a + h / 2 * b for a, b in zip(z, k2, strict=True)], u)
            k4 = slope([a + h * b for a, b in zip(z, k3, strict=True)], u)
            z = [
                a + h / 6 * (p + 2 * q + 2 * r + s)
                for a, p, q, r, s in zip(z, k1, k2, k3, k4, strict=True)
            ]
    kept = periods * samples
    x = np.array(position[-kept:]) + NOISE * rng.standard_normal(kept)
    return recording_from_arrays(np.array(late[-kept:]), x, period_s=PERIOD_S)


def cubic_drag() -> Basis:
    return Basis("drag", "drag", LOAD, lambda m: -(m.velocity**3))


@pytest.fixture(scope="module")
def dragged() -> Recording:
    return two_masses(drag=2.0)


def known(etfe: bh.Etfe) -> tuple[bh.Model, np.ndarray]:
    fit = bh.least_squares(bh.free(delay_s=0.0), etfe)
    return fit.model, fit.theta


def test_a_drag_is_sized_from_the_motion_that_it_makes(dragged: Recording) -> None:
    etfe = bh.estimate_etfe(dragged)
    windows, period = compress(etfe), one_period(etfe)
    model, theta = known(etfe)
    without = balance(model, windows, period, (), theta)
    found = balance(model, windows, period, (cubic_drag(),), theta)
    assert found.converged
    assert without.rms() > 5 and found.rms() < 1.2
    assert abs(found.strength[0] / 2.0 - 1) < 0.02
    values = dict(zip(model.names, found.theta, strict=True))
    assert values["kc"] == pytest.approx(TRUE["kc"], rel=5e-3)
    assert values["m1"] == pytest.approx(TRUE["m1"], rel=5e-3)


def test_the_loop_names_the_drag_and_leaves_noise(dragged: Recording) -> None:
    etfe = bh.estimate_etfe(dragged)
    fit = bh.least_squares(bh.free(delay_s=0.0), etfe)
    told = trace(etfe, fit, trials=LineTrials(etfe, fit, floor=0.0))
    assert any(test.flagged for test in told.before)
    assert [effect.name for effect in told.state.accepted] == ["cubic_damping"]
    state = told.state
    assert isinstance(state, BalancedState) and state.whole.forces[0].place == LOAD
    assert not any(test.flagged for test in told.after)
    assert state.fit.reduced_chi_square < 1.3
    assert (told.verdict, told.residual_class) == ("explained", "nonlinear")
    assert [c.name for c in told.candidates if c.accepted] == ["cubic_damping"]


def test_a_linear_device_gets_nothing() -> None:
    etfe = bh.estimate_etfe(two_masses(drag=0.0, seed=3))
    assert is_periodic(etfe)
    fit = bh.least_squares(bh.free(delay_s=0.0), etfe)
    assert not any(test.flagged for test in periodic_tests(fit, etfe))
    assert trace(etfe, fit).verdict == "consistent"


def test_motion_needs_a_force_that_repeats() -> None:
    rng = np.random.default_rng(1)
    force = rng.standard_normal(8000)
    position = np.cumsum(np.cumsum(force)) * 1e-6
    etfe = bh.estimate_etfe(recording_from_arrays(force, position, period_s=PERIOD_S))
    with pytest.raises(InputError, match="repeats"):
        one_period(etfe)


def test_every_force_has_its_place(dragged: Recording) -> None:
    etfe = bh.estimate_etfe(dragged)
    model, theta = known(etfe)
    part = balance(model, compress(etfe), one_period(etfe), (), theta)
    assert set(part.motions) == set(places_of(model.system(theta)))
    for variants in force_candidates(model, part.motions).values():
        for basis in variants:
            force = basis.force(part.motions[basis.place])
            assert force.shape == (1000,) and np.all(np.isfinite(force))
            assert basis.name == "backlash" or basis.unit
            assert basis.name != "backlash" or basis.place == CONNECTION


def servo(friction: float, seed: int = 0) -> Recording:
    """A mass of 90 kg with dry friction under a PD controller that follows a slow path."""
    rng = np.random.default_rng(seed)
    h, mass, damping = 1e-3, 90.0, 200.0
    time = np.arange(16_000) * h
    path = 0.1 * np.sin(2 * np.pi * 0.3 * time) + 0.03 * np.sin(2 * np.pi * 0.9 * time)
    x, v = 0.0, 0.0
    force, position = np.empty(len(time)), np.empty(len(time))
    for k, target in enumerate(path):
        position[k] = x + 1e-6 * rng.standard_normal()
        force[k] = 5e4 * (target - position[k]) - 3e3 * v - 3.0
        free = v + h / mass * (force[k] + 3.0 - damping * v)
        v = float(np.sign(free) * max(abs(free) - h / mass * friction, 0.0))
        x += h * v
    return recording_from_arrays(force, position, period_s=h)


def test_inverse_dynamics_of_a_servo() -> None:
    found = inverse_dynamics(servo(20.0), terms=("coulomb",))
    truth = {"mass": 90.0, "damping": 200.0, "coulomb": 20.0, "offset": -3.0}
    for name, value in truth.items():
        estimate, sd = found[name]
        assert abs(estimate - value) < max(4 * sd, 0.01 * abs(value)), name
    assert found.steps[1].held_out_rms < 0.3 * found.steps[0].held_out_rms


def test_inverse_dynamics_finds_the_friction_first() -> None:
    found = inverse_dynamics(servo(20.0))
    assert found.steps[1].term == "coulomb"
    assert np.all(np.diff([step.held_out_rms for step in found.steps]) < 0)


def test_inverse_dynamics_of_less_than_a_second_is_not_certain() -> None:
    """A mass in white noise of force: no sd may be far below that of ordinary least squares."""
    rng = np.random.default_rng(1)
    force = rng.standard_normal(900)
    velocity = np.cumsum(force) * 1e-3 / 5.0
    position = np.cumsum(velocity) * 1e-3
    recording = recording_from_arrays(force, position, period_s=1e-3)
    found = inverse_dynamics(recording, cutoff_hz=100.0)
    value, sd = found["mass"]
    assert sd > found.rms / np.sqrt(np.sum(found.path.acceleration**2)) / 2
    assert value == pytest.approx(5.0, rel=0.1)


def test_inverse_dynamics_refuses_in_one_line() -> None:
    recording = servo(0.0)
    with pytest.raises(InputError, match="no term nonsense"):
        inverse_dynamics(recording, terms=("nonsense",))
    with pytest.raises(InputError, match="too few"):
        inverse_dynamics(recording, cutoff_hz=1.0)


def test_the_published_values_of_emps(measured: Find) -> None:
    recording = bh.read_recording(measured("emps/DATA_EMPS.mat"), columns=SERVO_COLUMNS)
    found = inverse_dynamics(recording, terms=("coulomb",))
    published = {"mass": 95.1089, "damping": 203.5034, "coulomb": 20.3935, "offset": -3.1648}
    for name, value in published.items():
        estimate, sd = found[name]
        assert abs(estimate - value) < sd, name
    assert found.relative_error == pytest.approx(0.0408, abs=0.001)
    linear, friction = (step.held_out_rms for step in found.steps)
    assert linear == pytest.approx(9.1, abs=0.1) and friction == pytest.approx(2.2, abs=0.1)
    assert inverse_dynamics(recording).steps[-1].held_out_rms < 1.2


def test_the_motion_of_emps_in_its_loop(measured: Find) -> None:
    recording = bh.read_recording(measured("emps/DATA_EMPS.mat"), columns=SERVO_COLUMNS)
    found = fit_motion(recording)
    published = np.array([95.1089, 203.5034, 20.3935, -3.1648])
    assert found.converged
    # The 99 % interval of a Student t with eight degrees of freedom.
    assert np.all(np.abs(found.values[:4] - published) < 3.36 * found.sd[:4])
    assert np.all(found.sd[:4] < [0.5, 20.0, 2.0, 1.0]) and found.error_rms < 2e-6


def test_drag_predicts_lines_and_a_load_that_were_not_fitted(measured: Find) -> None:
    path = measured("two_mass_bench/MultisineTypeA.mat")
    etfe = bh.estimate_etfe(bh.read_recording(path, columns=BENCH_COLUMNS))
    witness = bh.read_recording(path, columns=WITNESS_COLUMNS)
    windows, period = compress(with_floor(etfe, 0.002)), one_period(etfe)
    beside = replace(etfe.recording, position=witness.position)
    load = one_period(replace(etfe, recording=beside))
    out = share(windows, REPORT)
    fit = bh.least_squares(bh.free(), etfe)
    base = balance(fit.model, windows, period, (), fit.theta, fitted=~out)
    drags = [
        b
        for b in force_candidates(fit.model, base.motions)["drag"]
        if b.place == LOAD and "power 5" in b.title
    ]
    found = balance(fit.model, windows, period, tuple(drags), base.theta, fitted=~out)
    assert found.converged and found.strength[0] > 20 * found.strength_sd[0]
    assert found.rms(out) < 0.65 * base.rms(out)

    def load_error(motions: dict) -> float:
        inside = (load.harmonics >= 11) & (load.harmonics <= 120)
        predicted = load.transform(motions[LOAD].position)[inside]
        return float(np.median(np.abs(predicted / load.transform(load.position)[inside] - 1)))

    assert load_error(found.motions) < 0.9 * load_error(base.motions)


def test_the_noise_between_periods_is_that_of_their_mean(dragged: Recording) -> None:
    example = load(EXAMPLES / "measured.py")
    etfe = bh.estimate_etfe(dragged)
    windows, period = compress(etfe), one_period(etfe)
    rng = np.random.default_rng(5)
    periods = rng.standard_normal((400, period.samples)) * 1e-4 + period.position
    noisy = example.between_periods(windows, period, periods)
    found = np.sqrt(noisy.scatter / (noisy.lines - 2)) / np.abs(windows.target[:, 0])
    line = np.abs(np.fft.rfft(period.position)[period.excited])
    expected = 1e-4 * np.sqrt(period.samples / 400) / line
    above = (expected > 1.3 * example.FLOOR) & (expected < 0.05)
    assert np.any(above) and np.any(expected < 0.7 * example.FLOOR)
    assert found[above] == pytest.approx(expected[above], rel=0.2)
    assert np.min(found) == pytest.approx(example.FLOOR)


def test_the_figures_of_the_bench_on_lines_that_were_not_fitted(
    measured: Find, tmp_path: Path
) -> None:
    example = load(EXAMPLES / "measured.py")
    benches = example.bench(measured("two_mass_bench/MultisineTypeA.mat"))
    result, between, _ = benches.values()
    out = result.held_out
    assert result.steps[0].rms(out) == pytest.approx(18.0, abs=0.5)
    assert result.steps[-1].rms(out) < 7.2
    assert between.steps[0].rms(out) == pytest.approx(15.0, abs=0.5)
    assert between.steps[-1].rms(out) < 5.3
    assert result.phase_deg(result.steps[-1], out) < 1.5
    assert between.phase_deg(between.steps[-1], out) < 1.25
    for found in (result, between):
        assert np.median(found.load_error(found.steps[-1])) < 0.022
    example.draw_bench(result, tmp_path)
    assert len(list(tmp_path.iterdir())) == 3
