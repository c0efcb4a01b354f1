"""Dampers that a device file gives as zero: their prior, their coordinates, and what they cost."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from on_the_bench import usual_noise

import bayeshaptic as bh
from bayeshaptic.inference import sampler
from bayeshaptic.inference.coordinates import sampling_coordinates
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.sampling import near_zero
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.laplace import _possible, laplace
from bayeshaptic.inference.sampling.near_zero import (
    _errors,
    _slope,
    inside,
    redrawing,
    resolved,
    start_of,
    with_near_zero,
)
from bayeshaptic.rig import Bench, simulate


def measured(seed: int) -> tuple[bh.Etfe, Bench]:
    bench = Bench.from_device("phantom")
    run = simulate(bench, seed=seed)
    recording = bh.recording_from_arrays(**run.signals)
    return bh.estimate_etfe(recording), bench


@pytest.fixture(scope="module")
def fitted():
    etfe, bench = measured(73000)
    fit = bh.least_squares(bh.free(device="phantom"), etfe)
    plain = sampling_coordinates(fit.model, fit.theta, fit.sd)
    return etfe, bench, fit, plain, with_near_zero(plain, fit)


def test_the_area_is_the_known_integral():
    """Goodwin and Staton's integral: -log r + (log 2 - Euler's constant) / 2 for small r."""
    for ratio in (1e-4, 1e-6, 1e-8):
        prior = bh.NearZero(3.0, 3.0 * ratio)
        area = np.exp(-prior.log_density(0.0)) / prior.floor
        assert area == pytest.approx(-np.log(ratio) + 0.5 * (np.log(2) - np.euler_gamma), abs=2e-3)


@pytest.mark.parametrize("seed", range(8))
def test_errors_of_directions_that_are_alike(seed):
    """Their square has lost them to rounding, and its inverse had variances below zero."""
    rng = np.random.default_rng(seed)
    same = 1e9 * rng.normal(size=50)
    same /= np.linalg.norm(same) / 1e9
    slope = np.stack([same, same, rng.normal(size=50)], axis=1)
    # Along (1, -1) the data say nothing and the prior of one says all: 1 / 2 of its variance each.
    assert _errors(slope)[:2] == pytest.approx([np.sqrt(0.5)] * 2, rel=1e-4)


def test_every_factor_is_alike():
    prior = bh.NearZero(1.0, 1e-6)
    decades = [1e-5, 1e-4, 1e-3, 1e-2]
    share = [
        np.mean((x := prior.quantile(np.linspace(0, 1, 20_001))) < 10 * d) - np.mean(x < d)
        for d in decades
    ]
    assert share == pytest.approx([share[1]] * 4, rel=0.1)
    assert prior.quantile(0.4) < 1e-3


def test_a_zero_fit_is_at_a_bound_and_leaves_no_error_bar(fitted):
    _, _, fit, _, _ = fitted
    index = fit.model.names.index("b2")
    assert fit.theta[index] == 0.0
    assert fit.outcome["b2"] == "at a bound" and np.isnan(fit.sd[index])


def test_a_misfit_at_the_upper_bound_is_not_next_to_zero(fitted):
    _, _, fit, plain, _ = fitted
    index = fit.model.names.index("b2")
    theta, covariance = fit.theta.copy(), fit.covariance.copy()
    theta[index] = 0.09
    covariance[index] = covariance[:, index] = np.nan
    high = replace(fit, theta=theta, covariance=covariance)
    assert with_near_zero(plain, high) is plain


def test_a_start_replaces_a_peak_outside_the_support(fitted):
    _, _, fit, _, here = fitted
    density, start = Density(fit.likelihood, here), start_of(here, fit)
    outside = start.copy()
    outside[fit.model.names.index("b1")] = here.low[fit.model.names.index("b1")] - 1.0
    assert _possible(density, outside, start) is start
    assert _possible(density, start, outside) is start


def test_a_start_beside_what_follows_lies_in_the_support(fitted):
    """A damper at zero that follows the small one below it, as a delay of nothing may."""
    _, _, fit, _, here = fitted
    index = fit.model.names.index("b1")
    theta, follow = fit.theta.copy(), here.follow.copy()
    theta[index] = here.low[index] * here.scale[index]
    follow[index] = -1e3
    there = replace(here, follow=follow)
    density = Density(fit.likelihood, there)
    assert np.isfinite(density(start_of(there, replace(fit, theta=theta))[None])[0])


def test_a_start_is_no_further_from_zero_than_precise_data_allow(fitted):
    _, _, fit, _, here = fitted
    g = fit.response(fit.windows.frequency_hz.ravel()).reshape(fit.windows.frequency_hz.shape)
    target = np.einsum("wij,wj->wi", fit.windows.design, g)
    exact = replace(fit.windows, target=target, scatter=1e-7 * fit.windows.scatter)
    precise = summarise(fit.model, exact, fit.theta)

    def lost(phi):
        likelihood = precise.likelihood(here.natural(phi[None]))[0]
        return precise.log_likelihood - likelihood

    assert lost(inside(here, precise, 0.3)) > 10 * fit.model.size
    assert lost(start_of(here, precise)) < fit.model.size
    assert (start_of(here, fit) == inside(here, fit, 0.3)).all()  # usual data let it


def test_coordinates_go_there_and_back_and_know_their_jacobian(fitted):
    _, _, fit, _, here = fitted
    index = fit.model.names.index("b2")
    assert here.near_zero == (index,)
    theta = np.tile(fit.theta, (5, 1))
    theta[:, index] = [0.0, 1e-9, 1e-7, 1e-5, 1e-3]
    phi = here.coordinate(theta)
    assert here.natural(phi) == pytest.approx(theta, rel=1e-9, abs=1e-18)
    assert here.inside(phi).all()
    below = phi.copy()
    below[:, index] = -1e-6
    assert not here.inside(below).any()
    logs = []
    for point in phi[1:]:
        step = np.diag(np.full(len(point), 1e-5))
        slope = (here.natural(point + step) - here.natural(point - step)) / 2e-5
        logs.append(np.linalg.slogdet(slope)[1])
    change = here.log_jacobian(phi[1:])
    assert logs - logs[0] == pytest.approx(change - change[0], abs=1e-5)


def test_others_follow_so_that_ridges_stay_straight(fitted):
    """Moving b2 alone costs hundreds of units of log likelihood, moving along next to none."""
    _, _, fit, plain, here = fitted
    index = fit.model.names.index("b2")
    start = start_of(here, fit)
    moved = start.copy()
    moved[index] = np.log1p(2e-5 / here.floor[0])
    along = fit.likelihood(here.natural(np.stack([start, moved])))
    alone = plain.coordinate(fit.theta)
    alone[index] += 2e-5 / plain.scale[index]
    assert along[0] - along[1] < 3
    assert along[0] - fit.likelihood(plain.natural(alone[None]))[0] > 300


def test_densities_of_both_coordinates_agree(fitted):
    """Up to a constant, once each density is one of the natural values."""
    _, _, fit, plain, here = fitted
    theta = here.natural(start_of(here, fit) + np.zeros((4, 1)))
    theta[:, fit.model.names.index("b2")] = [1e-8, 1e-7, 1e-6, 1e-5]
    values = []
    for coordinates in (plain, here):
        phi = coordinates.coordinate(theta)
        values.append(Density(fit.likelihood, coordinates)(phi) - coordinates.log_jacobian(phi))
    difference = values[0] - values[1]
    assert difference == pytest.approx(np.full(4, difference[0]), abs=1e-4)


def test_a_redraw_keeps_the_prior():
    """Metropolis steps with it alone, for a density that is the prior: all are accepted."""
    etfe, _ = measured(73001)
    fit = bh.least_squares(bh.free(device="phantom"), etfe)
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    propose = redrawing(here, fit)
    phi = np.tile(start_of(here, fit), (500, 1))
    drawn, factor = propose(phi, np.random.default_rng(0))
    index = here.near_zero[0]
    prior = fit.model.prior("b2")

    def log_density(points):
        return prior.log_density(here.natural(points)[:, index]) + points[:, index]

    assert log_density(drawn) - log_density(phi) + factor == pytest.approx(0.0, abs=1e-9)
    others = np.delete(np.arange(phi.shape[1]), index)
    assert np.array_equal(drawn[:, others], phi[:, others])
    below = np.mean(here.natural(drawn)[:, index] < prior.quantile(0.5))
    assert below == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(500))


def test_a_parameter_that_is_seen_is_sampled_as_it_is(fitted):
    _, _, fit, plain, _ = fitted
    model = fit.model.with_prior({"b1": bh.NearZero(1.0, 1e-6), "b2": bh.HalfNormal(1.0)})
    seen = bh.least_squares(model, fitted[0], start=fit.theta)
    there = sampling_coordinates(model, seen.theta, seen.sd)
    assert with_near_zero(there, seen) is there
    assert redrawing(there, seen) is None


def test_the_limit_of_a_published_zero_is_not_pushed_up():
    """A half-normal, flat next to zero, has the truth at ranks of 0.10, 0.01 and 0.13."""
    ranks = []
    for seed in range(73000, 73003):
        etfe, bench = measured(seed)
        posterior = bh.sample(bh.free(device="phantom"), etfe, ess=400, seed=seed)
        assert posterior.converged
        assert not posterior.prior_dominated["b2"]
        limit = bh.critical_stiffness(posterior)
        ranks.append(np.mean(limit.samples < bench.true_critical_stiffness()))
    assert min(ranks) > 0.05 and max(ranks) < 0.95
    assert np.mean(ranks) > 0.25


# Light on its bearings: what one damper has, the other could not give it.
LIGHT = {"m1": 0.05, "b1": 0.23, "bc": 22.6, "kc": 111e3, "m2": 3.1, "b2": 0.0}


def without_file(values: dict[str, float], seconds: float) -> tuple[bh.Etfe, bh.Fit, float]:
    bench = Bench.from_device("lhifam", values=values)
    noise = usual_noise(bench, seconds)
    etfe = bh.estimate_etfe(bh.recording_from_arrays(**simulate(bench, noise, seed=3).signals))
    fit = bh.least_squares(bh.free(delay_s=bench.delay_s, period_s=bench.period_s), etfe)
    return etfe, fit, bench.true_critical_stiffness()


@pytest.fixture(scope="module")
def light() -> tuple[bh.Etfe, bh.Fit, float]:
    return without_file(LIGHT, 30.0)


def test_a_light_device_without_a_file_has_its_limit(light):
    etfe, fit, truth = light
    posterior = bh.sample(fit.model, etfe, start=fit, ess=200, seed=1)
    low, high = bh.critical_stiffness(posterior).quantile([0.001, 0.999])
    assert posterior.converged and low < truth < high


def test_chains_that_agree_in_a_wrong_valley_have_not_converged(light, monkeypatch):
    etfe, fit, _ = light
    # As far up as a prior on every scale would have it, where the other damper cannot follow.
    scale = fit.model.prior("b1").scale
    prior = bh.NearZero(scale, 1e-6 * scale, 0.25)
    fit = bh.least_squares(fit.model.with_prior({"b1": prior, "b2": prior}), etfe, start=fit.theta)
    fit = replace(fit, alike=fit.alike[:0])  # which would show the right one
    monkeypatch.setattr(sampler, "start_of", lambda here, fit: inside(here, fit, 0.3))
    posterior = bh.sample(fit.model, etfe, start=fit, ess=200, seed=1, most_evaluations=100_000)
    assert not posterior.converged and "best fit" in posterior.message


def test_what_follows_a_small_damper_leans_on_a_wall_only_where_it_is_there_itself():
    """Its coordinate, what is left beside the small one, may be below zero all the same."""
    etfe = bh.estimate_etfe(Path(__file__).parents[2] / "data/recordings/lhifam-free.csv.gz")
    fit = bh.least_squares(bh.free(), etfe)
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    index = fit.model.names.index("delay_s")
    follow = here.follow.copy()
    small = fit.theta[list(here.near_zero)]
    follow[index] = 20 * fit.theta[index] / here.scale[index] / small / len(small)
    there = replace(here, follow=follow)
    start = there.coordinate(fit.theta)
    assert start[index] < 0 < there.own(start)[index]
    density = Density(fit.likelihood, there)
    peak, _ = laplace(density, start)
    assert density(peak[None])[0] > density(start[None])[0] - 5


def test_two_small_dampers_whose_sum_is_known_are_sampled_over_all_of_it():
    """By the logarithm of their ratio; in logarithms of their own chains stay at one end."""
    etfe, fit, _ = without_file({**LIGHT, "b1": 0.1, "b2": 0.2}, 10.0)
    fit = resolved(fit)
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    b1, b2 = fit.model.names.index("b1"), fit.model.names.index("b2")
    assert {here.beside, *here.near_zero} == {b1, b2}
    phi = np.tile(start_of(here, fit), (5, 1))
    phi[:, here.near_zero] = np.array([[-3.0], [-1.0], [0.0], [1.0], [3.0]])
    theta = here.natural(phi)
    assert here.inside(phi).all()
    assert here.coordinate(theta) == pytest.approx(phi, abs=1e-9)
    assert np.ptp(fit.likelihood(theta)) < 3
    logs = []
    for point in phi:
        step = np.diag(np.full(len(point), 1e-6))
        slope = (here.natural(point + step) - here.natural(point - step)) / 2e-6
        logs.append(np.linalg.slogdet(slope)[1])
    change = here.log_jacobian(phi)
    assert logs - logs[0] == pytest.approx(change - change[0], abs=1e-5)
    beyond = phi.copy()
    beyond[:, here.near_zero] = 40.0
    assert not here.inside(beyond).any()
    posterior = bh.sample(fit.model, etfe, start=fit, ess=200, seed=1)
    assert posterior.converged
    low, high = np.quantile(posterior.draws[:, b1], [0.1, 0.9])
    assert low < 0.01 and high > 0.23  # 0.04 and 0.15 in logarithms of each


def test_a_damper_that_others_are_measured_beside_has_less_for_more_of_them(light, monkeypatch):
    """And is the one that ends first; what two known sums leave open is one damper, not two."""
    _, fit, _ = light
    plain = sampling_coordinates(fit.model, fit.theta, fit.sd)
    values = fit.theta / plain.scale
    dampers = [fit.model.names.index(name) for name in ("b1", "b2", "bc")]
    small, middle, largest = sorted(dampers, key=lambda index: values[index])
    slope = np.zeros((4, len(values)))  # of a size that a change of each by itself is seen
    slope[:, small] = np.array([1e4, 0, 0, 0]) / values[small]
    slope[:, middle] = np.array([2e4, 1e4, 3, 0]) / values[middle]
    slope[:, largest] = np.array([2e3, 1e4, 0, 0]) / values[largest]
    slope[2, fit.model.names.index("kc")] = 1.0
    prior = bh.MaybeZero(1.0)
    monkeypatch.setattr(near_zero, "_candidates", lambda *_: dict.fromkeys(dampers, prior))
    monkeypatch.setattr(near_zero, "_slope", lambda *_: slope)
    two_sums = with_near_zero(plain, fit)
    assert two_sums.near_zero == (small,) and two_sums.beside == middle
    assert two_sums.follow[largest, 0] > 0  # it has more for more of the small one
    slope[1] = 0.0
    one_sum = with_near_zero(plain, fit)
    assert one_sum.beside == largest and set(one_sum.near_zero) == {small, middle}
    monkeypatch.setattr(near_zero, "_LONGEST", 1.0)
    followed = with_near_zero(plain, fit)
    assert middle not in followed.near_zero and small in followed.near_zero
    assert followed.beside is None  # the sum is not known where the one left out is not given


def test_a_damper_that_the_fit_leaves_nothing_is_sampled_beside_the_others(light):
    """In its logarithm others would bend along it, and chains stayed at one end of the ridge."""
    _, fit, _ = light
    bc = fit.model.names.index("bc")
    theta, covariance = fit.theta.copy(), fit.covariance.copy()
    theta[bc] = fit.model.prior("bc").quantile(1e-9)
    covariance[bc] = covariance[:, bc] = np.nan  # at a bound
    nothing = replace(fit, theta=theta, covariance=covariance)
    plain = sampling_coordinates(nothing.model, nothing.theta, nothing.sd)
    assert not plain.log[bc]
    assert bc in with_near_zero(plain, nothing).near_zero


def test_zero_weighs_no_more_than_there_is_room_for(light, monkeypatch):
    """Of two dampers whose sum alone is known the error of each is many times that sum."""
    _, fit, _ = light
    plain = sampling_coordinates(fit.model, fit.theta, fit.sd)
    whole, both = 4e-3, [fit.model.names.index(name) for name in ("b1", "b2")]
    theta = fit.theta.copy()
    theta[both] = whole, 0.0
    slope = 1e6 * np.eye(len(theta))
    slope[both] = 0.0
    slope[both[0], both] = 1e6 * plain.scale[both] / whole  # the sum to a millionth
    monkeypatch.setattr(near_zero, "_slope", lambda *_: slope)
    found = resolved(replace(fit, theta=theta))
    # Uniform up to the sum: its deviation, in those of half a normal; 1,000 draws know it to 2 %.
    room = whole / np.sqrt(12) / np.sqrt(1 - 2 / np.pi)
    seen = [found.model.prior(fit.model.names[index]).seen for index in both]
    assert seen == pytest.approx([room, room], rel=0.06)


def test_a_corner_that_every_axis_leads_out_of_leaves_the_errors(monkeypatch):
    """Nothing could be drawn beside it: zero had no width, and the report ended in a prior's."""
    axes = np.array([[2.0, -1, 2], [2, 2, -1], [-1, 2, 2]]) / 3  # each has both signs
    slope = np.diag([1.0, 10.0, 100.0]) @ axes
    monkeypatch.setattr(near_zero, "_slope", lambda *_: slope)
    here = SimpleNamespace(log=np.zeros(3, bool), low=np.zeros(3), scale=np.ones(3))
    room = near_zero._room(here, SimpleNamespace(theta=np.zeros(3)))
    assert room == pytest.approx(np.linalg.norm(near_zero.root_of_covariance(slope), axis=1))


@pytest.mark.parametrize(
    ("prior", "weight"), [(bh.MaybeZero(2.0, 0.01), 3), (bh.MaybeZero(2.0, 0.01, 1.5), 1.5)]
)
def test_zero_weighs_as_much_as_so_many_standard_deviations(prior, weight):
    near, far = np.array([0.0, *np.geomspace(1e-9, 0.002, 20_001)]), np.linspace(0.5, 0.53, 301)
    at_zero = np.trapezoid(np.exp(prior.log_density(near)), near)
    slab = np.exp(prior.log_density(0.03))
    assert at_zero == pytest.approx(weight * 0.01 * slab + 0.002 * slab, rel=1e-2)
    shape = prior.log_density(far) - bh.HalfNormal(2.0).log_density(far)
    assert shape == pytest.approx(np.log1p(-prior.zero), abs=1e-9)
    assert np.all(bh.MaybeZero(2.0).log_density(far) == bh.HalfNormal(2.0).log_density(far))


def test_sampling_takes_what_is_seen_from_the_fit():
    _, fit, _ = without_file({**LIGHT, "b1": 0.1, "b2": 0.2}, 10.0)
    assert fit.model.prior("b1").seen is None
    prior = resolved(fit).model.prior("b1")
    # Forward differences of the same residuals along other coordinates: of eight recordings they
    # are 5e-4 to 6e-4 apart.  With the other damper held the error is a fiftieth of that, or less.
    index = fit.model.names.index("b1")
    assert prior.seen == pytest.approx(fit.sd[index], rel=1e-3)
    own = fit.model.with_prior({"b1": bh.MaybeZero(1.0, 0.5)})
    assert resolved(replace(fit, model=own)).model.prior("b1").seen == 0.5


def test_a_motor_is_less_likely_without_damping_than_what_it_moves():
    _, fit, _ = without_file({**LIGHT, "b1": 0.1, "b2": 0.2}, 10.0)
    assert [fit.model.prior(name).weight for name in ("b1", "b2")] == [1.5, 3.0]


def test_a_damper_of_two_errors_may_be_next_to_zero_where_nobody_knows_its_size(fitted):
    """Its prior of many factors e, and the data, let it be a hundredth: a needle at the wall."""
    etfe, bench, _, _, _ = fitted
    fit = bh.least_squares(bh.free(delay_s=bench.delay_s), etfe)
    index = fit.model.names.index("bc")
    prior = fit.model.prior("bc")
    assert prior.log_sd > 1  # nobody knows

    def where_it_is(errors: float):
        """With noise in which it is so many of its errors."""
        plain = sampling_coordinates(fit.model, fit.theta, fit.sd)
        assert not plain.log[index]
        now = fit.theta[index] / (_errors(_slope(plain, fit))[index] * plain.scale[index])
        louder = replace(fit.windows, scatter=(now / errors) ** 2 * fit.windows.scatter)
        return with_near_zero(plain, summarise(fit.model, louder, fit.theta))

    here = where_it_is(2.0)
    assert index in here.near_zero and here.log[index]
    assert here.floor[here.near_zero.index(index)] == pytest.approx(prior.quantile(1e-3))
    assert index not in where_it_is(8.0).near_zero
