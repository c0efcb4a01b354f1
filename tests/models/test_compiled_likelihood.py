"""The compiled response and likelihood against the plain forms beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plain_response import plain_response

from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import (
    HalfNormal,
    LogNormal,
    LogUniform,
    MaybeZero,
    NearZero,
    Normal,
    Uniform,
)
from bayeshaptic.models.build import build_model
from bayeshaptic.models.joint_prior import joint_prior
from bayeshaptic.models.prior import Prior
from bayeshaptic.models.response.transfer import transfer
from bayeshaptic.recordings.response.windows import Windows

T = 1e-3
BATCH = 40
RNG = np.random.default_rng()


@pytest.fixture(autouse=True)
def same_draws() -> None:
    """Each test draws the same, whichever ran before it."""
    RNG.bit_generator.state = np.random.default_rng(7).bit_generator.state


def loops(structure: str):
    model = build_model(structure, "lhifam", delay_sd_s=2e-4)
    spread = np.exp(0.4 * RNG.standard_normal((BATCH, model.size)))
    return model.system(model.values * spread)


def some(low: float, high: float):
    return np.exp(RNG.uniform(np.log(low), np.log(high), BATCH))


def with_mass(system):
    heavier = system.mechanism.with_mass(some(0.01, 0.1), 0, some(0.1, 1), some(1e2, 1e4))
    return replace(system, mechanism=heavier)


def with_frame(system):
    mounted = system.mechanism.with_frame(some(1, 10), some(1, 10), some(1e4, 1e6))
    return replace(system, mechanism=mounted)


def with_lags(system):
    # Too fast for the series here and there; apart, since partial fractions do not bear poles that
    # coincide.
    for slowest, fastest in ((5e-4, 1e-2), (5e-5, 2e-4)):
        lag = some(slowest, fastest)
        system = system.with_filter(np.ones((1, BATCH)), np.stack([np.ones(BATCH), lag, lag**2]))
    return system


CHANGES = {
    "plain": lambda system: system,
    "more masses": lambda system: with_frame(with_mass(system)),
    "filters": with_lags,
    "both": lambda system: with_lags(with_mass(system)),
    "fast poles": lambda system: replace(
        system,
        mechanism=system.mechanism.with_mass(some(1e-5, 1e-3), 0, some(0.1, 1), some(1e3, 1e4)),
    ),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("structure", ["rigid", "free", "grasped"])
@pytest.mark.parametrize("top", [300.0, 500.0])
def test_the_compiled_response_is_the_plain_one(structure, change, top) -> None:
    system = CHANGES[change](loops(structure))
    frequency = np.append(np.geomspace(0.3, 0.999 * top, 60), top)
    plain = plain_response(system.mechanism, system.filters, system.delay_s, frequency, T)
    compiled = system.sampled_response(frequency, T)
    # Beside a zero both forms lose digits against their own size around it.
    size = np.maximum(np.abs(plain), 1e-3 * np.abs(plain).max(axis=1, keepdims=True) / frequency)
    assert np.max(np.abs(compiled - plain) / size) < 1e-10


@pytest.mark.parametrize("change", CHANGES)
def test_transfer_functions_from_the_record_are_those_of_the_trees(change) -> None:
    mechanism = CHANGES[change](loops("grasped")).mechanism
    for compiled, plain in zip(transfer(mechanism), mechanism.transfer(), strict=True):
        np.testing.assert_allclose(compiled, plain.T, rtol=1e-14)


def windows(nodes: int) -> Windows:
    count = 37

    def complex_(*shape: int):
        return RNG.standard_normal(shape) + 1j * RNG.standard_normal(shape)

    frequency = np.sort(RNG.uniform(1, 300, (count, nodes)), axis=0)
    design = 1e4 * np.triu(complex_(count, nodes, nodes))
    target, scatter = complex_(count, nodes), RNG.uniform(1, 5, count)
    return Windows(frequency, design, target, scatter, RNG.integers(20, 40, count).astype(float))


@pytest.mark.parametrize("nodes", [1, 2, 3])
def test_the_compiled_likelihood_is_the_plain_formula(nodes: int) -> None:
    model = build_model("grasped", "lhifam")
    likelihood = Likelihood(model, windows(nodes))
    theta = model.values * np.exp(0.3 * RNG.standard_normal((20, model.size)))
    left = likelihood.plain_deviations(theta)
    power = likelihood.windows.scatter + np.sum(np.abs(left) ** 2, axis=2)
    truth = -(likelihood.windows.lines - 1) * np.log(power)
    np.testing.assert_allclose(likelihood.deviations(theta), left, rtol=0, atol=1e-10)
    np.testing.assert_allclose(likelihood.pointwise(theta), truth, rtol=1e-10)
    np.testing.assert_allclose(likelihood(theta), truth.sum(axis=1), rtol=1e-10)


def test_no_value_depends_on_the_batch_around_it() -> None:
    model = build_model("grasped", "lhifam", delay_sd_s=1e-4)
    likelihood = Likelihood(model, windows(3))
    theta = model.values * np.exp(0.5 * RNG.standard_normal((33, model.size)))
    theta[5:9, model.names.index("delay_s")] = 3e-4  # the tables of a delay are kept
    theta[7, model.names.index("kc")] *= 300  # by its poles alone, which needs no tables
    theta[20:26, model.names.index("delay_s")] = 4e-4
    theta[[20, 22, 23], model.names.index("kc")] *= 300
    together = likelihood(theta)
    assert np.array_equal(together, [likelihood(row[None])[0] for row in theta])
    assert np.array_equal(together[::-1], likelihood(theta[::-1]))


def test_logarithms_of_any_size() -> None:
    """The kernel takes its own logarithms."""
    model = build_model("rigid", "lhifam")
    few = windows(3)
    for size in (1e-200, 1e-9, 1.0, 1e9, 1e200):
        scaled = replace(
            few, scatter=size * few.scatter, design=0 * few.design, target=0 * few.target
        )
        truth = -np.sum((few.lines - 1) * np.log(scaled.scatter))
        assert Likelihood(model, scaled)(model.values[None])[0] == pytest.approx(truth, rel=1e-14)
    far = replace(few, design=1e300 * few.design)
    assert not Likelihood(model, far)(model.values[None])[0] > -np.inf


class Own(Prior):
    """A prior from outside, known by its density alone."""

    coordinate = "log"
    support = (0.0, np.inf)

    def log_density(self, x):
        return -np.asarray(x, float)


def test_priors_at_once_are_the_sum_of_each() -> None:
    priors = (
        LogNormal(2.0, 0.5),
        HalfNormal(3.0),
        NearZero(1.0, 1e-4),
        Normal(1.0, 2.0, low=-0.5),
        Normal(1.0, 2.0),
        Own(),
        Uniform(-1.0, 2.0),
        LogUniform(0.1, 5.0),
        MaybeZero(2.0, 0.3),
        MaybeZero(1.0),
    )
    theta = RNG.normal(0.7, 0.4, (1000, len(priors)))
    theta[0], theta[1] = 0.0, 0.1
    with np.errstate(all="ignore"):
        truth = np.sum([p.log_density(x) for p, x in zip(priors, theta.T, strict=True)], axis=0)
    assert 50 < np.isfinite(truth).sum() < 950
    np.testing.assert_allclose(joint_prior(priors)(theta), truth, rtol=1e-12)
