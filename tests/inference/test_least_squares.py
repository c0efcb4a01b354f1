"""Least squares: unknown devices from the data alone, several starts, bounds, error bars."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from linear_bench import LHIFAM_FREE, Device
from on_the_bench import usual_noise

from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.valleys import _other_valleys
from bayeshaptic.models import LogNormal, free, grasped, rigid
from bayeshaptic.numerics.gauss_newton import _damped_step, jacobian, minimise
from bayeshaptic.numerics.truncated_normal import draw_above, moments_above
from bayeshaptic.recordings import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from benchmarks.strangers.any_device import make as any_device

fitting = sys.modules[least_squares.__module__]
CASES = [("lhifam", False), ("phantom", True)]


def measure(bench: Bench, seed: int, seconds: float = 30.0):
    noise = usual_noise(bench, seconds)
    return as_recorded(simulate(bench, noise, seed=seed))


def as_recorded(run):
    recording = Recording(run.force, run.position, run.period_s, run.force_unit, run.position_unit)
    return estimate_etfe(recording)


@pytest.fixture(scope="module", params=CASES, ids=lambda case: f"{case[0]}-{case[1]}")
def unknown(request):
    """A 30 s recording fitted without a device file, from two seeds."""
    device, held = request.param
    bench = Bench.from_device(device, held=held)
    etfe = measure(bench, seed=21)
    model = (grasped if held else free)()
    return bench, etfe, [least_squares(model, etfe, seed=seed) for seed in (0, 1)]


def test_the_truth_is_found_from_the_data_alone(unknown):
    bench, _, (fit, _) = unknown
    truth = np.array([bench.values.get(name, bench.delay_s) for name in fit.model.names])
    # 330 complex residuals, F-distributed: a standard deviation of 0.06.
    assert fit.reduced_chi_square == pytest.approx(1.0, abs=0.25)
    seen = np.array([fit.outcome[name] == "converged" for name in fit.model.names])
    assert {"m1", "kc", "m2", "delay_s"} <= {
        n for n, s in zip(fit.model.names, seen, strict=True) if s
    }
    pulls = (fit.theta - truth)[seen] / fit.sd[seen]
    assert np.abs(pulls).max() < 4.5  # of up to twelve: a chance of 1e-4
    assert np.sqrt(np.mean(pulls**2)) < 2.0


def test_other_starts_end_at_the_same_optimum(unknown):
    _, _, (fit, other) = unknown
    assert fit.starts >= 2
    assert other.reduced_chi_square == pytest.approx(fit.reduced_chi_square, rel=1e-4)
    width = np.where(np.isfinite(fit.sd), fit.sd, np.inf)
    assert np.all(np.abs(other.theta - fit.theta) < 0.1 * width)


def test_what_a_fit_carries(unknown):
    bench, etfe, (fit, _) = unknown
    assert fit.model.period_s == etfe.period_s
    assert fit.model.force_unit == bench.force_unit
    assert fit.residual.shape == fit.frequency_hz.shape == (fit.windows.target.size,)
    freedom = len(fit.residual) - 0.5 * fit.model.size
    assert np.sum(np.abs(fit.residual) ** 2) / freedom == pytest.approx(fit.reduced_chi_square)
    assert fit.log_likelihood == pytest.approx(float(fit.likelihood(fit.theta[None])[0]))
    assert np.allclose(
        fit.response(etfe.frequency_hz), fit.model.response(fit.theta, etfe.frequency_hz)
    )
    # The fit runs through the points that a person sees.
    z = (fit.response(etfe.frequency_hz) - etfe.value) / np.sqrt(etfe.variance)
    assert np.mean(np.abs(z) ** 2) < 1.5


def test_the_delay_is_found_as_well_as_it_says(unknown):
    bench, _, (fit, _) = unknown
    error = fit.theta[-1] - bench.delay_s
    assert abs(error) < 4.5 * fit.sd[-1] < 0.02 * bench.period_s


def test_pulls_of_many_short_recordings():
    """Errors over their standard deviations, with the device file: rms one."""
    bench = Bench.from_device("lhifam")
    truth = np.array([bench.values[name] for name in free("lhifam").names])
    model, pulls = free("lhifam"), []
    for seed in range(12):
        fit = least_squares(model, measure(bench, seed, seconds=12.0))
        pulls.append((fit.theta - truth) / fit.sd)
    pulls = np.array(pulls)[:, [0, 2, 3, 4]]  # dampers to the ground may stand at their bound
    # Twelve recordings of four parameters, correlated: some 30 independent squares.
    assert np.sqrt(np.mean(pulls**2)) == pytest.approx(1.0, abs=0.35)


def test_a_parameter_at_a_bound_has_no_error_bar_and_the_others_have():
    """The PHANToM has b2 = 0: about half of all fits end there."""
    bench = Bench.from_device("phantom")
    fits = [least_squares(free("phantom"), measure(bench, seed, 10.0)) for seed in range(6)]
    at_bound = [fit.outcome["b2"] == "at a bound" for fit in fits]
    assert any(at_bound) and not all(at_bound)
    for fit, bound in zip(fits, at_bound, strict=True):
        assert np.isnan(fit.sd[-1]) == bound
        assert fit.theta[-1] == 0.0 if bound else fit.theta[-1] > 0
        assert np.isfinite(np.delete(fit.sd, -1)).all()


def test_what_the_data_do_not_decide_is_said():
    """A tight prior against a recording that says nothing of the transmission's damper."""
    bench = Bench.from_device("lhifam")
    model = free("lhifam", prior={"bc": LogNormal(15.0, 1e-4)})
    fit = least_squares(model, measure(bench, 3, 10.0))
    assert fit.outcome["bc"] in ("prior-dominated", "at a bound")
    assert fit.outcome["m1"] == "converged"


def test_a_mass_behind_a_spring_to_the_ground_may_as_well_be_the_ground(unknown):
    stick = Bench("rigid", {"m": 0.2, "b": 3.7}, 1e-3, 5e-4, "N", encoder_resolution=1e-3)
    stick = stick.with_effect("centring_stiffness", stiffness=565.0)
    noise = WhiteNoise(25.0, 60.0, 0.3, 5.0)
    fits = [least_squares(free(), as_recorded(simulate(stick, noise, seed))) for seed in range(3)]
    assert [fit.as_ground for fit in fits] == [("m2",)] * 3
    # One over it is not clearly above zero, at whatever tons the search for it ends.
    assert "at a bound" not in {fit.outcome["m2"] for fit in fits[1:]}
    assert all(fit.run_away for fit in fits)
    *_, (fit, _) = unknown
    assert not fit.as_ground and not fit.run_away


def test_a_model_that_lacks_something_says_so_in_its_chi_square():
    bench = Bench.from_device("lhifam")
    etfe = measure(bench, 4, 10.0)
    poor = least_squares(rigid("lhifam"), etfe)
    good = least_squares(free("lhifam"), etfe)
    assert poor.reduced_chi_square > 100 * good.reduced_chi_square
    # Its error bars grow with it.
    plain = poor.covariance / poor.reduced_chi_square
    assert np.sqrt(plain[0, 0]) < 0.1 * poor.sd[0]


def test_a_start_of_ones_own():
    bench = Bench.from_device("phantom", held=True)
    etfe = measure(bench, 5)
    model = grasped("phantom")
    near = least_squares(model, etfe, start=1.02 * model.values)
    best = least_squares(model, etfe)
    assert near.log_likelihood == pytest.approx(best.log_likelihood, abs=0.1)
    assert near.starts == 1


# Reduced chi-square of each set of starting points: sets taken, that which is kept, other valleys.
SETS = {
    (1.1,): (1, 1.1, 0),
    (9.0, 1.1): (2, 1.1, 1),
    (9.0, 9.1, 9.0, 4.0, 9.0, 9.0): (6, 4.0, 1),
    (4.0, 9.0, 8.0, 4.01, 3.99, 7.0): (6, 4.0, 2),
}


@pytest.mark.parametrize("sets", SETS)
def test_where_the_model_misfits_more_sets_follow(sets, monkeypatch):
    """Two that end alike may be wrong alike."""
    model = free("phantom")
    etfe = measure(Bench.from_device("phantom"), 5, 5.0)
    fit = least_squares(model, etfe)
    found = fitting.refine(fit.model, compress(etfe), fit.theta)
    left = [replace(found, reduced_chi_square=chi) for chi in sets]
    alone = replace(fit, elsewhere=np.empty((0, len(fit.theta))))

    def followed(_model, _etfe, one):
        return replace(alone, reduced_chi_square=one.reduced_chi_square)

    monkeypatch.setattr(fitting, "refine", lambda *_: left.pop(0))
    monkeypatch.setattr(fitting, "_followed", followed)
    best = least_squares(model, etfe)
    taken = len(sets) - len(left)
    assert (taken, best.reduced_chi_square, len(best.elsewhere)) == SETS[sets]


def test_noiseless_data_give_the_truth_to_many_digits():
    rng = np.random.default_rng(0)
    force = rng.standard_normal(20_000)
    recording = Recording(force, Device(LHIFAM_FREE).simulate(force), 1e-3)
    fit = least_squares(free("lhifam"), estimate_etfe(recording, band_hz=(2.0, 300.0)))
    assert fit.theta == pytest.approx(free("lhifam").values, rel=2e-3)
    masses = [fit.model.names.index(name) for name in ("m1", "m2", "kc")]
    assert fit.theta[masses] == pytest.approx(free("lhifam").values[masses], rel=1e-5)


def test_gauss_newton_on_a_problem_with_a_known_answer():
    """Rosenbrock's valley, and the same with its optimum cut off by a bound."""

    def residuals(phi):
        return np.stack([10 * (phi[:, 1] - phi[:, 0] ** 2), 1 - phi[:, 0]], axis=1)

    start = np.array([[-1.2, 1.0], [0.3, -0.8], [2.0, 2.0]])
    box = np.full(2, -3.0), np.full(2, 3.0)
    phi, cost = minimise(residuals, start, *box, steps=200, tolerance=1e-14)
    assert phi == pytest.approx(np.ones((3, 2)), abs=1e-5)
    assert cost == pytest.approx(np.zeros(3), abs=1e-10)
    cut, _ = minimise(residuals, start, box[0], np.array([0.5, 3.0]), steps=200, tolerance=1e-14)
    assert cut == pytest.approx(np.tile([0.5, 0.25], (3, 1)), abs=1e-5)
    slope = jacobian(residuals, np.array([[0.5, 2.0]]))
    assert slope[0] == pytest.approx(np.array([[-10.0, 10.0], [-1.0, 0.0]]), abs=1e-4)


def test_a_step_along_two_equal_directions_after_many_wins():
    """Friction that holds a device left such a fit without damping: a traceback."""
    rng = np.random.default_rng(0)
    wide, no_damping = np.full(3, 1e3), np.array([1e-40])
    for _ in range(50):  # rounding decides which of them have a pivot of zero
        same = rng.normal(size=(50, 1)) * 1e5
        slope = np.concatenate([same, same, rng.normal(size=(50, 1))], axis=1)
        value = rng.normal(size=50)
        normal, gradient = slope.T @ slope, slope.T @ value
        step = _damped_step(normal[None], gradient[None], no_damping, np.zeros((1, 3)), -wide, wide)
        left = value + slope @ step[0]
        # A least-squares solution leaves nothing along any direction.
        assert np.all(np.abs(slope.T @ left) < 1e-6 * np.linalg.norm(slope, axis=0))


@pytest.mark.parametrize("mean", [-6.0, -1.0, 0.0, 0.7, 5.0])
def test_moments_of_a_truncated_normal(mean):
    from scipy.stats import truncnorm

    found, spread = moments_above(np.zeros(1), np.array([2 * mean]), np.array([[4.0]]), 2000)
    truth = truncnorm(-mean, np.inf, loc=2 * mean, scale=2.0)
    # 2000 draws.
    assert found[0] == pytest.approx(truth.mean(), abs=5 * truth.std() / np.sqrt(2000))
    assert spread[0, 0] == pytest.approx(truth.var(), rel=0.2)


def test_moments_of_two_truncated_normals():
    rng = np.random.default_rng(0)
    mean, covariance = np.array([0.3, -0.5]), np.array([[1.0, -0.8], [-0.8, 1.0]])
    found, spread = moments_above(np.zeros(2), mean, covariance, 2000)
    draws = rng.multivariate_normal(mean, covariance, 2_000_000)
    draws = draws[np.all(draws > 0, axis=1)]
    assert found == pytest.approx(draws.mean(axis=0), abs=5 * draws.std() / np.sqrt(2000))
    assert spread == pytest.approx(np.cov(draws.T), rel=0.2)


def test_a_wall_that_may_be_the_value_itself():
    """Of two numbers whose sum is known, the smaller may be none."""
    from scipy.stats import norm, truncnorm

    rng = np.random.default_rng(1)
    count, sd, spike = 20_000, 2.0, 3.0
    small, large, sum_sd = -1.0, 30.0, 0.01  # their means, and the error of the sum
    covariance = np.array([[sd**2, -(sd**2)], [-(sd**2), sd**2 + sum_sd**2]])
    mean, every = np.tile([small, large], (count, 1)), np.tile(covariance, (count, 1, 1))
    draws = draw_above(np.zeros(2), mean, every, rng, np.array([spike, 0.0]))
    odds = spike * norm.pdf(small / sd) / norm.cdf(small / sd)
    zero = odds / (1 + odds)
    error = np.sqrt(zero * (1 - zero) / count)
    assert np.mean(draws[:, 0] == 0.0) == pytest.approx(zero, abs=4 * error)
    assert draws.min() == 0.0
    left = draws.sum(axis=1) - small - large
    assert left.mean() == pytest.approx(0.0, abs=4 * sum_sd / np.sqrt(count))
    assert left.std() == pytest.approx(sum_sd, rel=0.03)
    beside = draws[draws[:, 0] > 0, 0]
    truth = truncnorm(-small / sd, np.inf, loc=small, scale=sd)
    assert beside.mean() == pytest.approx(truth.mean(), abs=4 * truth.std() / np.sqrt(len(beside)))


def test_valleys_where_several_starts_end_are_kept_beside_the_best():
    ended = np.array([[1.0], [2.0], [2.01], [3.0], [5.0], [5.01], [5.02]])
    cost = np.array([10.0, 50.0, 50.4, 200.0, 90.2, 90.0, 90.5])
    np.testing.assert_array_equal(_other_valleys(ended, cost), [[5.01], [2.0]])
    assert _other_valleys(ended[:1], cost[:1]).shape == (0, 1)


def test_a_start_or_a_period_that_does_not_fit_is_refused(unknown) -> None:
    _, etfe, _ = unknown
    for start in (np.ones(2), np.ones((3, 2)), 1.0):
        with pytest.raises(InputError, match="start has the shape|start is 1.0"):
            least_squares(rigid(delay_s=None), etfe, start=start)
    with pytest.raises(InputError, match="start is .*; give numbers other than NaN or infinity"):
        least_squares(rigid(), etfe, start=np.full(3, np.nan))
    with pytest.raises(InputError, match=r"period_s is 0\.002 s, and .* every 0\.001 s; leave"):
        least_squares(rigid(period_s=2e-3), etfe)
    # Of a device the data come first, as in a report, which says so.
    device = replace(load_device("phantom"), period_s=2e-3)
    fit = least_squares(rigid(device=device), etfe, start=rigid(device=device).values)
    assert fit.model.period_s == etfe.period_s


def test_a_mode_above_half_the_sampling_rate_is_found() -> None:
    # A small motor on a stiff transmission: its mode, at 884 Hz, looks like one of 116 Hz.
    values = {"m1": 0.05, "b1": 0.08, "bc": 6.3, "kc": 1.53e6, "m2": 6.5, "b2": 4.8}
    bench = replace(Bench.from_device("lhifam"), values=values)
    fit = least_squares(free(), measure(bench, seed=5, seconds=20.0))
    assert not fit.misfits
    assert fit.theta[fit.model.names.index("kc")] == pytest.approx(1.53e6, rel=0.01)


def test_the_likeliest_valley_of_a_held_device_is_found_from_other_starts_too() -> None:
    recording = any_device(433, clean=True).recording
    etfe = estimate_etfe(recording)
    fits = [least_squares(grasped(), etfe, seed=seed) for seed in (0, 1)]
    assert max(fit.reduced_chi_square for fit in fits) < 1.1  # no fit says that there is a better
    one, other = (fitting._log_density(fit) for fit in fits)
    assert abs(one - other) < 0.1  # 23 where the first set of starting points is the only one
