"""The first proposal of the sampler: where walls cut a ridge, and where it all but misses."""

from __future__ import annotations

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.inference.coordinates import sampling_coordinates
from bayeshaptic.inference.density import Density
from bayeshaptic.inference.ensembles import _spread_start
from bayeshaptic.inference.importance import Adapted, adapt
from bayeshaptic.inference.laplace import laplace
from bayeshaptic.inference.mixture import student
from bayeshaptic.rig import Bench, WhiteNoise, simulate

# Dampers of which only the sum is known: b1 is within its error of zero.
RIDGE = {"m1": 1.44e-3, "b1": 0.57e-3, "bc": 5.1e-3, "kc": 34.7, "m2": 0.113e-3, "b2": 25e-3}


@pytest.fixture(scope="module")
def on_a_ridge():
    bench = Bench.from_device("phantom", values=RIDGE)
    noise = WhiteNoise(bench.force_rms, bench.band_hz[1], bench.band_hz[0], 30.0)
    run = simulate(bench, noise, seed=1010)
    recording = bh.recording_from_arrays(
        run.force, run.position, period_s=1e-3, force_unit="Nm", position_unit="rad"
    )
    fit = bh.least_squares(bh.free(device="phantom"), bh.estimate_etfe(recording))
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
    assert adapt(density, proposal, np.random.default_rng(1)).efficiency > 0.3


def test_walkers_start_inside_even_where_the_proposal_misses(on_a_ridge):
    fit, here, density = on_a_ridge
    peak, _ = laplace(density, here.coordinate(fit.theta))
    far = student(peak + 1e3, 1e6 * np.eye(len(peak)))
    missing = Adapted(far, far.sample(np.random.default_rng(2), 2000), np.full(2000, 5e-4), 0.0)
    start = _spread_start(density, missing, peak, np.random.default_rng(3))
    assert start.shape == (64, fit.model.size)
    assert np.isfinite(density(start)).all()
    assert np.linalg.matrix_rank(start - start.mean(axis=0), tol=1e-12) == fit.model.size
