"""The first proposal of the sampler: where walls cut a ridge, and where it all but misses."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from on_the_bench import usual_noise

import bayeshaptic as bh
from bayeshaptic.effects.library import effect_class
from bayeshaptic.inference.coordinates import sampling_coordinates
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.ensembles import _spread_start, warmed_up
from bayeshaptic.inference.sampling.laplace import laplace
from bayeshaptic.numerics.mixture import student
from bayeshaptic.numerics.weights import effective, normalised
from bayeshaptic.rig import Bench, simulate

# Dampers of which only the sum is known: b1 is within its error of zero.
RIDGE = {"m1": 1.44e-3, "b1": 0.57e-3, "bc": 5.1e-3, "kc": 34.7, "m2": 0.113e-3, "b2": 25e-3}


def _recording() -> bh.Recording:
    bench = Bench.from_device("phantom", values=RIDGE)
    noise = usual_noise(bench, 30.0)
    run = simulate(bench, noise, seed=1010)
    return bh.recording_from_arrays(**run.signals)


def efficiency(density, first, peak) -> float:
    """Kish's effective share of draws, weighed to be of `density`, that warming up ends with."""
    proposal = warmed_up(density, first, np.random.SeedSequence(1), peak).proposal
    drawn = proposal.mixture.sample(np.random.default_rng(1), 2000)
    log_weights = density(proposal.straightening.bent(drawn)) - proposal.mixture.log_density(drawn)
    return effective(normalised(log_weights)) / 2000


@pytest.fixture(scope="module")
def on_a_ridge():
    fit = bh.least_squares(bh.free(device="phantom"), bh.estimate_etfe(_recording()))
    here = sampling_coordinates(fit.model, fit.theta, fit.sd)
    return fit, here, Density(fit.likelihood, here)


def test_a_ridge_that_a_wall_cuts_is_followed(on_a_ridge):
    fit, here, density = on_a_ridge
    index = fit.model.names.index("b1")
    assert fit.sd[index] > fit.theta[index]  # or the wall would be out of reach
    peak, proposal = laplace(density, here.coordinate(fit.theta))
    fitted = density.beyond_walls(here.coordinate(fit.theta)[None])[0]
    # One parameter has moved by about a standard deviation: a few units, not hundreds.
    assert density(peak[None])[0] > fitted - 5
    assert np.isfinite(density(proposal.sample(np.random.default_rng(0), 500))).mean() > 0.5
    assert efficiency(density, proposal, peak) > 0.3


def test_walkers_start_inside_even_where_the_proposal_misses(on_a_ridge):
    fit, here, density = on_a_ridge
    peak, _ = laplace(density, here.coordinate(fit.theta))
    far = student(peak + 1e3, 1e6 * np.eye(len(peak)))
    start = _spread_start(density, far, peak, np.random.default_rng(3))
    assert start.shape == (64, fit.model.size)
    assert np.isfinite(density(start)).all()
    assert np.linalg.matrix_rank(start - start.mean(axis=0), tol=1e-12) == fit.model.size

    def nowhere(phi):
        return np.full(len(phi), -np.inf)

    assert (_spread_start(nowhere, far, peak, np.random.default_rng(3)) == peak).all()


def test_a_fit_at_the_end_of_a_prior_still_finds_the_peak(on_a_ridge):
    """Following a wall's ridge must not lead out of another prior's support, into nothing."""
    fit, _, _ = on_a_ridge
    value = fit.theta[fit.model.names.index("bc")]
    for prior in (bh.LogUniform(1.001 * value, 10 * value), bh.LogUniform(0.1 * value, value)):
        model = fit.model.with_prior({"bc": prior})
        there = bh.least_squares(model, bh.estimate_etfe(_recording()), start=fit.theta)
        here = sampling_coordinates(model, there.theta, there.sd)
        density = Density(there.likelihood, here)
        for end in (0.0, 1e-8, -1e-8):  # of rounding
            peak, proposal = laplace(density, here.coordinate(there.theta) + end)
            assert density(peak[None])[0] > there.log_likelihood - 20
            drawn = proposal.sample(np.random.default_rng(0), 2000)
            assert np.isfinite(density(drawn)).mean() > 0.1
            assert efficiency(density, proposal, peak) > 0.2


def test_only_a_logarithm_overflows(on_a_ridge) -> None:
    """A mass of 10,000 times the spread of its prior is in its support."""
    fit, here, _ = on_a_ridge
    linear = np.flatnonzero(~here.log)[0]
    scale = here.scale.copy()
    scale[linear] = 1e-4 * fit.theta[linear]
    low, high = here.low * here.scale / scale, here.high * here.scale / scale
    far = replace(here, scale=scale, low=low, high=high)
    phi = far.coordinate(fit.theta[None])
    assert phi[0, linear] > 1000
    assert np.isfinite(Density(fit.likelihood, far)(phi)[0])


def test_of_two_springs_side_by_side_none_is_a_logarithm() -> None:
    """The data know their sum: a fit may leave one of them nothing, and its error is then nan."""
    plain = bh.grasped(device="lhifam")
    reflex = effect_class("reflex")
    etfe = SimpleNamespace(band_hz=(0.5, 300.0), period_s=1e-3, force_unit="N", position_unit="m")
    springy = plain.with_effect(reflex.candidates(plain, etfe)[0])
    for model, log in ((plain, True), (springy, False)):
        theta = np.array([model.prior(name).quantile(0.5) for name in model.names], float)
        sd = 0.01 * theta
        at = model.names.index("kh")
        theta[at], sd[at] = 2.0, np.nan
        assert sampling_coordinates(model, theta, sd).log[at] == log


def test_a_prior_that_rises_towards_its_wall_does_not_go_on_rising_beyond(on_a_ridge):
    """Its slope at the wall, followed further, outweighed any likelihood and the peak was lost."""
    fit, _, _ = on_a_ridge
    model = fit.model.with_prior({"b1": bh.NearZero(0.1, 1e-7, 0.25)})
    here = sampling_coordinates(model, fit.theta, fit.sd)
    density, index = Density(replace(fit.likelihood, model=model), here), model.names.index("b1")
    inside = np.tile(here.coordinate(fit.theta), (4, 1))
    inside[:, index] = (1e-6, 1e-3, 0.1, 1.0)
    behind = inside.copy()
    behind[:, index] *= -1
    theta = here.natural(inside)
    prior = density.beyond_walls(behind) - density.likelihood(here.natural(behind))
    assert prior == pytest.approx(model.log_prior(theta) + here.log_jacobian(inside), abs=1e-6)
    peak, _ = laplace(density, here.coordinate(fit.theta))
    assert density(peak[None])[0] > density(here.coordinate(fit.theta)[None])[0] - 20
