"""The region of stable walls beside brute force: eigenvalues, and walls on the virtual bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from effect_cases import CASES

import bayeshaptic as bh
from bayeshaptic.models import build_model
from bayeshaptic.rig import Bench, run_wall
from bayeshaptic.rig.truth import sampled_loop
from bayeshaptic.stability.walls.damping import Backward, LowPass, derivative, derivative_at_nyquist
from bayeshaptic.stability.walls.region import kb_region, with_damping

FILTERS = (Backward(), LowPass(200.0), LowPass(40.0))
DELAYS = (0.0, 0.2e-3, 1e-3, 1.4e-3, 2.6e-3)
EFFECTS = ("extra_delay", "actuator_lag", "position_filter", "reflex", "second_mode")


def known(name, device, delay_s=0.2e-3):
    return build_model(name, device, delay_s=delay_s, delay_sd_s=0.0)


def radii(bench, damping, stiffness, levels):
    """Spectral radius on a grid, shape (J, I), by the bench's own eigenvalues."""
    loop = sampled_loop(bench.plant(), bench.period_s)
    a = damping.smoothing(bench.period_s)
    closed = [loop.closed(stiffness, b, a) for b in levels]
    return np.abs(np.linalg.eigvals(np.array(closed))).max(axis=-1)


def grid(region, points=16):
    """Beyond the region on both sides, off its corners."""
    width = region.z_width(0.5)
    shares = (np.arange(points) + 0.37) / points * 1.3
    return shares * width.stiffness, shares * width.damping


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
@pytest.mark.parametrize("name", ["rigid", "free", "grasped"])
def test_no_point_is_on_the_wrong_side(device, name):
    for delay_s in DELAYS:
        base = kb_region(known(name, device, delay_s))
        bench = Bench.from_device(device, mechanism=name, delay_s=delay_s)
        for damping in FILTERS:
            region = with_damping(base, damping)
            stiffness, levels = grid(region)
            truth = radii(bench, damping, stiffness, levels)
            clear = np.abs(truth - 1) > 1e-9
            assert 0.05 < (truth < 1).mean() < 0.95
            assert np.all((region.stable(stiffness, levels)[0] == (truth < 1))[clear])


@pytest.mark.parametrize("case", [c for c in CASES if c.name in EFFECTS], ids=lambda c: c.id)
def test_models_with_effects(case):
    model = case.base.with_effect(case.effect)
    region = kb_region(model, theta=case.theta(model))
    for damping in FILTERS[::2]:
        region = with_damping(region, damping)
        stiffness, levels = grid(region, 4 if case.name == "reflex" else 8)
        truth = radii(case.truth, damping, stiffness, levels)
        clear = np.abs(truth - 1) > 1e-6  # a delayed force is a chain of steps on the bench
        assert np.all((region.stable(stiffness, levels)[0] == (truth < 1))[clear])


@pytest.mark.parametrize("damping", [Backward(), LowPass(60.0)])
def test_limit_at_each_damping_is_where_a_pole_leaves_the_circle(damping):
    for name in ("rigid", "free", "grasped"):
        bench = Bench.from_device("lhifam", mechanism=name)
        region = kb_region(build_model(name, "lhifam", delay_sd_s=0.0), damping)
        levels = region.dampings(6)
        limit = region.limits(levels)[0]
        for level, value in zip(levels[:-1], limit[:-1], strict=True):
            below, above = radii(bench, damping, value * np.array([1 - 1e-5, 1 + 1e-5]), [level])[0]
            assert below < 1 < above


@pytest.mark.parametrize("cutoff_hz", [None, 80.0])
def test_walls_on_the_bench_at_ten_points_on_either_side(cutoff_hz):
    damping = Backward() if cutoff_hz is None else LowPass(cutoff_hz)
    bench = Bench.from_device("phantom", held=True).quiet()
    region = kb_region(build_model("grasped", "phantom", delay_sd_s=0.0), damping)
    levels = np.linspace(0.02, 0.9, 10) * region.largest_damping()[0]
    for level, limit in zip(levels, region.limits(levels)[0], strict=True):
        for share in (0.95, 1.05):
            wall = run_wall(bench, share * limit, level, seconds=3.0, push=0.1, cutoff_hz=cutoff_hz)
            assert wall.stable == (share < 1), (level, share)


def test_without_damping_it_is_the_critical_stiffness():
    model = build_model("grasped", "phantom", delay_sd_s=20e-6)
    rng = np.random.default_rng(5)
    draws = model.values * np.exp(0.1 * rng.standard_normal((300, model.size)))
    expected = bh.critical_stiffness(model, draws).samples
    region = kb_region(model, theta=draws)
    np.testing.assert_allclose(region.limits([0.0])[:, 0], expected, rtol=1e-7)
    middle = float(np.median(expected))
    assert region.probability(middle, 0.0) == pytest.approx(0.5, abs=0.01)
    assert region.quantile(0.1, [0.0])[0] == pytest.approx(np.quantile(expected, 0.1), rel=0.01)


def test_probability_is_the_share_of_stable_loops():
    model = build_model("free", "lhifam", delay_sd_s=20e-6)
    rng = np.random.default_rng(6)
    draws = model.values * np.exp(0.2 * rng.standard_normal((60, model.size)))
    region = kb_region(model, LowPass(100.0), draws)
    stiffness, levels = np.array([1e4, 2.5e4, 6e4]), np.array([0.0, 40.0, 120.0])
    benches = [
        Bench(
            "free",
            {name: value for name, value in zip(model.names, row, strict=True) if name[0] in "mbk"},
            delay_s=row[-1],
        )
        for row in draws
    ]
    truth = np.mean([radii(b, LowPass(100.0), stiffness, levels) < 1 for b in benches], axis=0)
    assert 0.1 < truth.mean() < 0.9
    np.testing.assert_allclose(region.probability_map(stiffness, levels), truth, atol=1e-12)
    np.testing.assert_allclose(region.probability(stiffness, 40.0), truth[1], atol=1e-12)
    assert isinstance(region.probability(1e4, 0.0), float)


def test_the_region_of_a_case_begins_at_its_own_limit():
    model = build_model("free", "lhifam", delay_sd_s=20e-6)
    rng = np.random.default_rng(7)
    draws = model.values * np.exp(0.02 * rng.standard_normal((500, model.size)))
    limit = bh.critical_stiffness(model, draws)
    wide = replace(limit, samples=limit.samples * np.exp(0.1 * rng.standard_normal(500)))

    class Widened:
        pass

    case = Widened()
    case.model, case.draws, case.limit = model, draws, wide
    region = kb_region(case)
    for risk in (0.05, 0.5):
        assert region.quantile(risk, [0.0])[0] == pytest.approx(wide.quantile(risk), rel=0.02)


def test_a_loop_unstable_at_rest_is_stable_nowhere():
    model = build_model("grasped", "lhifam", delay_sd_s=0.0)
    values = dict(zip(model.names, model.values, strict=True)) | {"kh": -5e3}
    region = kb_region(model, theta=[values[name] for name in model.names])
    assert region.probability(1e4, 10.0) == 0.0
    assert region.limits([0.0, 10.0]).max() == 0.0


def test_z_width_and_tables_agree():
    model = build_model("grasped", "lhifam", delay_sd_s=0.0)
    region = kb_region(model)
    width = region.z_width(0.05)
    low, high = (region.probability(width.stiffness * f, width.at_damping) for f in (0.999, 1.001))
    assert (low, high) == (1.0, 0.0)
    assert width.area == pytest.approx(
        np.trapezoid(width.boundary.stiffness, width.boundary.damping)
    )
    assert region.says(0.05) is False  # one loop says nothing about risks


def test_low_pass_reaches_its_cutoff_and_the_difference_without_smoothing():
    theta = np.linspace(1e-3, np.pi, 200)
    plain = derivative(Backward(), theta, 1e-3)
    np.testing.assert_allclose(plain, -np.expm1(-1j * theta) / 1e-3, rtol=1e-12)
    at = np.array([2 * np.pi * 20.0 * 1e-3])
    ratio = abs(derivative(LowPass(20.0), at, 1e-3) / derivative(Backward(), at, 1e-3))
    assert ratio == pytest.approx(np.sqrt(0.5), rel=0.01)
    assert derivative_at_nyquist(Backward(), 1e-3) == 2000.0
    with pytest.raises(bh.InputError, match="cutoff_hz is 0.0; give a number above 0"):
        LowPass(0.0)


def test_more_delay_never_widens_the_region():
    late, early = (kb_region(known("free", "lhifam", delay_s)) for delay_s in (0.7e-3, 0.2e-3))
    levels = late.dampings(5)
    assert np.all(late.limits(levels) < early.limits(levels))
