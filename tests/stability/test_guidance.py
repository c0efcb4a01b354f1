"""Shares, elasticities, sweeps, and what a further recording would narrow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.next_experiment import information, next_experiment
from bayeshaptic.models import build_model
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.stability.cases import Case
from bayeshaptic.stability.guidance.elasticities import elasticities, with_delay
from bayeshaptic.stability.guidance.guidance import usual_sweeps
from bayeshaptic.stability.guidance.shares import explained, tied_groups, variance_shares
from bayeshaptic.stability.guidance.sweep import sweep


def case(model, draws):
    return Case("one", "held", model, draws, bh.critical_stiffness(model, draws))


def spread(model, width, draws=3000, seed=1):
    rng = np.random.default_rng(seed)
    return model.values * np.exp(width * rng.standard_normal((draws, model.size)))


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
@pytest.mark.parametrize("name", ["rigid", "free", "grasped"])
def test_elasticities_are_those_of_the_critical_stiffness(name, device):
    model, values = with_delay(
        build_model(name, device, delay_sd_s=0.0),
        build_model(name, device, delay_sd_s=0.0).values[None],
    )
    (found,) = elasticities(build_model(name, device, delay_sd_s=0.0))
    assert found.names[-1] == "delay_s"
    for column, parameter in enumerate(model.names):
        moved = np.repeat(values, 2, axis=0)
        moved[:, column] *= [1.001, 0.999]
        up, down = bh.critical_stiffness(model, moved).samples
        slope = np.log(up / down) / np.log(1.001 / 0.999)
        assert found.median[parameter] == pytest.approx(slope, rel=3e-4, abs=2e-4)


def test_masses_dampers_and_springs_together_scale_the_limit():
    # Twice the masses, dampers and springs are twice the stiffness: elasticities add up to one.
    for name in ("free", "grasped"):
        (found,) = elasticities(build_model(name, "phantom", delay_sd_s=0.0))
        total = sum(value for key, value in found.median.items() if key != "delay_s")
        assert total == pytest.approx(1.0, abs=1e-6)


def test_a_damper_at_zero_still_has_a_slope():
    model = build_model("grasped", "phantom", delay_sd_s=0.0)
    (found,) = elasticities(model)
    assert found.median["b2"] == 0.0
    more = model.values + 1e-6 * (np.array(model.names) == "b2")
    change = bh.critical_stiffness(model, more).value / bh.critical_stiffness(model).value - 1
    assert found.slope["b2"] == pytest.approx(change / 1e-6, rel=1e-2)


def test_shares_of_independent_parameters_follow_the_elasticities():
    model = build_model("grasped", "phantom", delay_sd_s=0.0)
    draws = spread(model, 0.02)
    found = variance_shares(case(model, draws))
    (local,) = elasticities(case(model, draws))
    squares = {name: local.median[name] ** 2 for name in model.names}
    for share in found.shares:
        (name,) = share.names
        assert share.share == pytest.approx(squares[name] / sum(squares.values()), abs=0.03)
    assert found.together == pytest.approx(1.0, abs=0.05)
    assert found.beyond == 0.0


def test_tied_parameters_are_taken_together():
    model = build_model("free", "lhifam", delay_sd_s=0.0)
    draws = spread(model, 0.003)
    b1, b2 = (model.names.index(name) for name in ("b1", "b2"))
    draws[:, b1] = np.random.default_rng(3).uniform(0, 3.0, len(draws))
    draws[:, b2] = 6.9 - draws[:, b1]
    found = variance_shares(case(model, draws))
    groups = {share.names for share in found.shares}
    assert ("b1", "b2") in groups
    tied = next(share for share in found.shares if len(share.names) == 2)
    assert tied.correlation < -0.99


def test_noise_explains_nothing_and_a_function_everything():
    rng = np.random.default_rng(4)
    x = rng.standard_normal((3000, 2))
    assert explained(x[:, :1], rng.standard_normal(3000), 3000) < 0.01
    assert explained(x[:, :1], np.sin(x[:, 0]), 3000) > 0.98
    assert explained(x, x[:, 0] * x[:, 1], 3000) > 0.99
    assert explained(x[:, :1], x[:, 0] * x[:, 1], 3000) < 0.02
    mixed = np.stack([x[:, 0], x[:, 0] + 0.1 * x[:, 1], x[:, 1]], axis=1)
    assert tied_groups(mixed) == [[0, 1], [2]]


def test_what_widens_the_limit_beyond_the_parameters_has_its_share():
    model = build_model("free", "phantom", delay_sd_s=0.0)
    one = case(model, spread(model, 0.03))
    own = np.std(np.log(one.limit.samples))
    noise = np.exp(own * np.random.default_rng(5).standard_normal(len(one.draws)))
    wide = replace(one, limit=replace(one.limit, samples=one.limit.samples * noise))
    assert variance_shares(wide).beyond == pytest.approx(0.5, abs=0.05)
    assert variance_shares(wide).together < 1.1


def test_the_sweep_finds_where_the_mode_takes_over():
    model = build_model("free", "lhifam", delay_sd_s=0.0)
    found = sweep(model, "b2", factors=np.linspace(0.8, 1.4, 25))
    (jump,) = found.jumps
    assert (jump.before, jump.after) == ("rigid body", "vibration mode")
    for share, hertz in ((0.97, jump.before_hz), (1.03, jump.after_hz)):
        values = dict(zip(model.names, model.values, strict=True)) | {"b2": share * jump.value}
        limit = bh.critical_stiffness(model, [values[name] for name in model.names])
        assert limit.frequency_hz[0] == pytest.approx(hertz, rel=0.1)
    at = np.argmin(np.abs(found.values - model.values[model.names.index("b2")]))
    assert found.middle[at] == pytest.approx(bh.critical_stiffness(model).value, rel=1e-6)


def test_added_damping_raises_the_limit_of_a_rigid_device():
    model = build_model("rigid", "phantom", delay_sd_s=0.0)
    found = sweep(case(model, spread(model, 0.05, 200)), "b", add=[0.0, 0.01])
    assert found.added and found.middle[1] > 2 * found.middle[0]
    assert np.all((found.low <= found.middle) & (found.middle <= found.high))
    assert [one.name for one in usual_sweeps(model)] == ["b"]
    with pytest.raises(bh.InputError, match="no parameter kc in the rigid model; it has m, b"):
        sweep(model, "kc")


def recorded(held, seconds, seed, force=1.0, band_hz=None):
    bench = Bench.from_device("phantom", held=held)
    low, high = band_hz or bench.band_hz
    noise = WhiteNoise(force * bench.force_rms, high, low, seconds=seconds)
    run = simulate(bench, noise, seed=seed)
    units = {"force_unit": run.force_unit, "position_unit": run.position_unit}
    return bh.estimate_etfe(recording_from_arrays(run.force, run.position, run.period_s, **units))


@pytest.fixture(scope="module")
def fits():
    model = build_model("grasped", "phantom", delay_sd_s=0.0)
    return {t: least_squares(model, recorded(True, t, 3), start=model.values) for t in (15.0, 30.0)}


def predicted(fit):
    slopes = [(one.slope, one.crossing.probability) for one in elasticities(fit)]
    return {one.name: one for one in next_experiment(fit, slopes, 63.0)}


def test_twice_as_long_narrows_the_limit_as_predicted(fits):
    short, long = (predicted(fits[seconds])["again"] for seconds in (15.0, 30.0))
    assert short.ratio == pytest.approx(np.sqrt(0.5), abs=0.02)
    now = long.log_sd / long.ratio
    assert now == pytest.approx(short.log_sd, rel=0.2)


def test_slopes_of_nothing_in_the_fit_are_refused(fits):
    for slopes, words in (([], "slopes is empty"), ([({"zz": 1.0}, 1.0)], "none of the fit's")):
        with pytest.raises(bh.InputError, match=words):
            next_experiment(fits[15.0], slopes)


def test_the_prediction_is_the_spread_of_the_limit(fits):
    fit = fits[30.0]
    known = information(fit)
    covariance = np.linalg.inv(known.fisher() + known.prior_precision())
    rng = np.random.default_rng(8)
    phi = known.here.coordinate(fit.theta[None])
    draws = known.here.natural(rng.multivariate_normal(phi[0], covariance, 600))
    limit = bh.critical_stiffness(fit.model, np.abs(draws))
    again = predicted(fit)["again"]
    assert again.log_sd / again.ratio == pytest.approx(np.std(np.log(limit.samples)), rel=0.25)


def test_more_force_says_more_and_another_hand_less(fits):
    found = predicted(fits[30.0])
    assert set(found) == {"again", "louder", "band", "another user", "no user"}
    assert found["louder"].ratio < found["again"].ratio <= found["another user"].ratio + 1e-9
    assert all(0 < one.ratio <= 1 for one in found.values())


@pytest.mark.parametrize("name", ["again", "louder", "band"])
def test_the_recording_that_was_proposed_says_what_was_predicted(fits, name):
    fit = fits[30.0]
    options = {"louder": {"force": 2.0}, "band": {"band_hz": (63.0 / 2**0.5, 63.0 * 2**0.5)}}
    windows = compress(recorded(True, 30.0, 12, **options.get(name, {})), fit.response)
    made = information(summarise(fit.model, windows, fit.theta)).fisher()
    known, slope = information(fit), elasticities(fit)[0].slope
    prior, gradient = known.prior_precision(), known.gradient(slope)

    def spread(total):
        return np.sqrt(gradient @ np.linalg.solve(total + prior, gradient))

    ratio = spread(known.fisher() + made) / spread(known.fisher())
    assert predicted(fit)[name].ratio == pytest.approx(ratio, rel=0.08)
