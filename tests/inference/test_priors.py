"""Priors: densities, quantiles, draws, and the coordinates that they are sampled in."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest

from bayeshaptic.errors import InputError
from bayeshaptic.inference.coordinates import coordinates, reach, sampling_coordinates
from bayeshaptic.models import (
    HalfNormal,
    LogNormal,
    LogUniform,
    MaybeZero,
    NearZero,
    Normal,
    Prior,
    Uniform,
    build_model,
    draw,
    prior_from_table,
)

PRIORS = [
    LogNormal(55.3e3, 0.5),
    LogNormal(1e-3, 3.0),
    HalfNormal(2.5),
    NearZero(2.5, 0.1),
    NearZero(0.017, 1.7e-8),
    NearZero(0.017, 1.7e-8, 0.25),
    MaybeZero(2.5),
    MaybeZero(2.5, 0.1),
    MaybeZero(0.1, 0.5),
    MaybeZero(2.5, 0.1, 1.5),
    Normal(200e-6, 20e-6),
    Normal(1.0, 2.0, low=0.0),
    Normal(-1.0, 0.5, low=0.0),  # all but cut off
    Uniform(-2.0, 5.0),
    LogUniform(1e-3, 1e2),
]


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_density_integrates_to_one_between_its_own_quantiles(prior):
    levels = np.array([1e-6, 0.01, 0.2, 0.5, 0.9, 0.999])
    points = prior.quantile(levels)
    assert np.all(np.diff(points) > 0)
    for low, high, p, q in zip(points, points[1:], levels, levels[1:], strict=False):
        if low > 0:  # in the logarithm, where a density over many decades is tame
            area, _ = quad(
                lambda u: np.exp(u + prior.log_density(np.exp(u))), np.log(low), np.log(high)
            )
        else:
            area, _ = quad(lambda x: np.exp(prior.log_density(x)), low, high)
        assert area == pytest.approx(q - p, rel=1e-6)


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_nothing_lies_outside_the_support(prior):
    low, high = prior.support
    if np.isfinite(low):
        assert prior.log_density(low - 1e-6 * (1 + abs(low))) == -np.inf
        assert prior.quantile(0.0) == pytest.approx(low)
    if np.isfinite(high):
        assert prior.log_density(high * (1 + 1e-6)) == -np.inf
        assert prior.quantile(1.0) == pytest.approx(high)
    assert prior.log_density(np.full((2, 3), prior.quantile(0.3))).shape == (2, 3)


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_draws_are_distributed_as_the_density_says(prior):
    x = draw(prior, np.random.default_rng(1), 4000)
    low, high = prior.support
    assert np.all((x >= low) & (x <= high))
    points = np.quantile(x, np.linspace(0, 1, 9))
    share = np.diff(np.searchsorted(np.sort(x), points)) / len(x)
    for begin, end, found in zip(points, points[1:], share, strict=False):
        area, _ = quad(lambda v: np.exp(prior.log_density(v)), begin, end, limit=200)
        assert area == pytest.approx(found, abs=4 * np.sqrt(1 / 8 / len(x)))


@pytest.mark.parametrize("prior", PRIORS, ids=str)
def test_description_has_the_unit(prior):
    assert isinstance(prior, Prior)
    assert "N s/m" in prior.describe("N s/m")


def test_the_jacobian_of_the_coordinates_points_the_right_way():
    """Metropolis in the coordinates, without data: natural values must follow their priors.

    With the Jacobian upside down a log-normal's median would be off by a factor exp(2 log_sd^2).
    """
    model = build_model("free", "lhifam", delay_s=2e-4, delay_sd_s=1e-4)
    model = model.with_prior({"kc": LogUniform(1e4, 1e5), "bc": Uniform(1.0, 20.0)})
    here = coordinates(model)
    rng = np.random.default_rng(2)
    walkers = 3000
    theta = np.stack([draw(model.prior(n), rng, walkers) for n in model.names], axis=1)
    phi = here.coordinate(np.tile(np.median(theta, axis=0), (walkers, 1)))

    def density(phi):
        value = np.full(len(phi), -np.inf)
        inside = here.inside(phi)
        natural = here.natural(phi[inside])
        value[inside] = model.log_prior(natural) + here.log_jacobian(phi[inside])
        return value

    width = here.coordinate(theta).std(axis=0)
    value = density(phi)
    for step in range(600):
        moved = phi.copy()
        column = step % model.size
        moved[:, column] += 2.4 * width[column] * rng.standard_normal(walkers)
        there = density(moved)
        accept = np.log(rng.uniform(size=walkers)) < there - value
        phi[accept], value[accept] = moved[accept], there[accept]
    natural = here.natural(phi)
    for i, name in enumerate(model.names):
        prior = model.prior(name)
        ranks = np.interp(
            natural[:, i], prior.quantile(np.linspace(0, 1, 4001)[1:-1]), np.linspace(0, 1, 3999)
        )
        assert kstest(ranks, "uniform").pvalue > 1e-3, name


def test_coordinates_there_and_back():
    model = build_model("grasped", "phantom", delay_s=1e-4, delay_sd_s=1e-5)
    rng = np.random.default_rng(3)
    theta = np.stack([draw(model.prior(n), rng, 50) for n in model.names], axis=1)
    for here in (coordinates(model), coordinates(model, linear=["m1", "bh"])):
        assert here.coordinate(theta) == pytest.approx(here.coordinate(theta))
        assert here.natural(here.coordinate(theta)) == pytest.approx(theta, rel=1e-12)
        assert here.inside(here.coordinate(theta)).all()
        step = 1e-6
        for i in range(model.size):  # the Jacobian against a difference, up to a constant
            up, down = here.coordinate(theta), here.coordinate(theta)
            up[:, i] += step
            down[:, i] -= step
            slope = (here.natural(up)[:, i] - here.natural(down)[:, i]) / (2 * step)
            expected = theta[:, i] if here.log[i] else here.scale[i]
            assert slope == pytest.approx(np.broadcast_to(expected, 50), rel=1e-6)
        assert here.log_jacobian(here.coordinate(theta)) == pytest.approx(
            np.log(theta[:, here.log]).sum(axis=1)
        )


def test_walls_are_where_a_density_ends_abruptly():
    model = build_model("grasped", "lhifam", delay_s=1e-4, delay_sd_s=1e-4)
    here = coordinates(model, linear=["bh", "m1"])
    walled = {name for name, wall in zip(model.names, here.walls, strict=True) if wall}
    assert walled == {"b1", "b2", "delay_s"}  # a log-normal density is zero at zero by itself


def test_masses_and_dampers_are_sampled_as_they_are_where_they_are_known():
    model = build_model("free", period_s=1e-3, delay_s=2e-4).with_prior(
        {name: LogNormal(1.0, 3.0) for name in ("m1", "bc", "kc", "m2")}
        | {name: HalfNormal(1.0) for name in ("b1", "b2")}
    )
    theta = np.ones(6)
    sd = np.array([0.1, 0.1, 5.0, 0.1, np.nan, np.nan])
    log = sampling_coordinates(model, theta, sd).log
    assert dict(zip(model.names, log.tolist(), strict=True)) == {
        "m1": False,  # known to a tenth
        "b1": False,
        "bc": True,  # known to a factor e^5
        "kc": True,  # springs stay logarithms
        "m2": True,  # at a bound, and the prior is wide
        "b2": False,
    }


def test_reach_of_a_fit_is_the_priors():
    model = build_model("free", "lhifam")
    low, high = reach(model, 6.0)
    assert low[model.names.index("b1")] == 0.0
    kc = model.names.index("kc")
    assert (low[kc], high[kc]) == pytest.approx(
        (55.3e3 * np.exp(-3.0), 55.3e3 * np.exp(3.0)), rel=1e-6
    )


@pytest.mark.parametrize(
    ("table", "prior"),
    [
        ({"median": 2.0, "log_sd": 0.3}, LogNormal(2.0, 0.3)),
        ({"scale": 2}, HalfNormal(2.0)),
        ({"scale": 2, "floor": 1e-3}, NearZero(2.0, 1e-3)),
        ({"scale": 2, "seen": 1e-3}, MaybeZero(2.0, 1e-3)),
        ({"scale": 2, "seen": 1e-3, "weight": 1}, MaybeZero(2.0, 1e-3, 1.0)),
        ({"scale": 2, "floor": 1e-3, "rise": 0.5}, NearZero(2.0, 1e-3, 0.5)),
        ({"mean": 1.0, "sd": 0.1}, Normal(1.0, 0.1)),
        ({"mean": 1.0, "sd": 0.1, "low": 0}, Normal(1.0, 0.1, 0.0)),
        ({"low": 1, "high": 2}, Uniform(1.0, 2.0)),
        ({"low": 1, "high": 2, "log": True}, LogUniform(1.0, 2.0)),
    ],
)
def test_priors_from_a_table(table, prior):
    assert prior_from_table("kc", table) == prior


@pytest.mark.parametrize(
    "table",
    [
        {},
        {"median": 1.0},
        {"median": -1.0, "log_sd": 0.5},
        {"scale": "wide"},
        {"scale": 0.0},
        {"low": 2.0, "high": 1.0},
        {"low": 0.0, "high": 1.0, "log": True},
        {"mean": 0.0, "sd": 1.0, "log": True, "width": 3},
    ],
)
def test_bad_tables_name_the_parameter(table):
    with pytest.raises(InputError, match="prior of kc"):
        prior_from_table("kc", table)


@pytest.mark.parametrize(
    ("form", "numbers"),
    [
        (LogNormal, (0.0, 1.0)),
        (LogNormal, (1.0, np.nan)),
        (HalfNormal, (-1.0,)),
        (MaybeZero, (0.0,)),
        (MaybeZero, (1.0, 0.0)),
        (MaybeZero, (1.0, 0.1, 0.0)),
        (NearZero, (1.0, 0.0)),
        (NearZero, (1.0, 2.0)),
        (NearZero, (1.0, 1e-3, 1.0)),
        (NearZero, (np.nan, 1e-3)),
        (Normal, (0.0, 0.0)),
        (Uniform, (1.0, 1.0)),
        (LogUniform, (-1.0, 1.0)),
    ],
)
def test_impossible_priors_are_refused(form, numbers):
    with pytest.raises(InputError):
        form(*numbers)
