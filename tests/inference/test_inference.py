"""Fit, posterior and archive on simulated recordings of devices whose truth is known."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.errors import InputError
from bayeshaptic.inference.choose import choose_model
from bayeshaptic.inference.saved.arviz_groups import import_arviz
from bayeshaptic.models import HalfNormal, LogNormal, LogUniform, NearZero, Normal, Uniform, draw
from bayeshaptic.numerics.mixture import student
from bayeshaptic.numerics.mixture_fit import fit_student_mixture
from bayeshaptic.rig import Bench, simulate


def measured(device: str, held: bool, seed: int) -> tuple[bh.Etfe, Bench]:
    bench = Bench.from_device(device, held=held)
    run = simulate(bench, seed=seed)
    recording = bh.recording_from_arrays(**run.signals)
    return bh.estimate_etfe(recording), bench


@pytest.fixture(scope="module")
def held_phantom():
    etfe, bench = measured("phantom", True, seed=11)
    fit = bh.least_squares(bh.grasped(device="phantom"), etfe)
    return etfe, bench, fit, bh.sample(fit.model, etfe, start=fit, ess=1000, seed=3)


@pytest.mark.parametrize(
    ("device", "held"), [("lhifam", False), ("lhifam", True), ("phantom", False), ("phantom", True)]
)
def test_an_unknown_device_is_found_from_the_data_alone(device, held):
    etfe, bench = measured(device, held, seed=5)
    model = bh.grasped() if held else bh.free()
    fit = bh.least_squares(model, etfe)
    # F-distributed windows: about 330 complex residuals, so 0.06 is one standard deviation.
    assert fit.reduced_chi_square == pytest.approx(1.0, abs=0.25)
    for name in ("m1", "kc"):
        index = fit.model.names.index(name)
        error = fit.theta[index] - bench.values[name]
        assert abs(error) < 5 * fit.sd[index], name


def test_any_set_of_starts_leads_to_the_same_optimum():
    etfe, _ = measured("phantom", True, seed=4)
    fits = [bh.least_squares(bh.grasped(), etfe, seed=s) for s in range(8)]
    assert max(fit.reduced_chi_square for fit in fits) < 1.25


def test_a_parameter_at_its_bound_has_no_error_bar():
    etfe, _ = measured("phantom", False, seed=2)
    fits = [bh.least_squares(bh.free(device="phantom"), etfe, seed=s) for s in range(2)]
    assert np.allclose(fits[0].theta, fits[1].theta, rtol=1e-3, atol=1e-5)
    for i, name in enumerate(fits[0].model.names):
        assert np.isnan(fits[0].sd[i]) == (fits[0].outcome[name] == "at a bound")


def test_the_posterior_holds_the_truth(held_phantom):
    _, bench, _, posterior = held_phantom
    assert posterior.converged, posterior.message
    truth = np.array([bench.values[name] for name in posterior.names])
    pulls = (posterior.draws.mean(axis=0) - truth) / posterior.draws.std(axis=0)
    # Eleven correlated pulls of one recording: 4 is a chance of less than 1e-3.
    assert np.abs(pulls).max() < 4
    limit = bh.critical_stiffness(posterior)
    low, high = limit.quantile([0.0005, 0.9995])
    assert low < bench.true_critical_stiffness() < high


def test_the_sampler_agrees_with_a_plain_stretch_run(held_phantom):
    import emcee

    from bayeshaptic.inference.coordinates import coordinates
    from bayeshaptic.inference.sampling.density import Density
    from bayeshaptic.inference.sampling.near_zero import with_near_zero

    _, _, fit, posterior = held_phantom
    here = with_near_zero(coordinates(fit.model), fit)  # without it no stretch run sees all of b2
    density = Density(fit.likelihood, here)
    start = here.coordinate(posterior.draws[:: len(posterior.draws) // 64][:64])
    plain = emcee.EnsembleSampler(64, fit.model.size, density, vectorize=True)
    plain.random_state = np.random.RandomState(1).get_state()
    plain.run_mcmc(start, 1500, skip_initial_state_check=True)
    drawn = here.natural(plain.get_chain(discard=100, flat=True))
    sd = posterior.draws.std(axis=0)
    # 1400 steps of 64 walkers at an autocorrelation time of about 90: 1000 effective draws, and
    # as many of ours: a mean is known to sqrt(2/1000) = 0.045 sd, a sd to 3 %; five of each.
    assert np.abs(drawn.mean(axis=0) - posterior.draws.mean(axis=0)) == pytest.approx(
        np.zeros(fit.model.size), abs=0.22 * sd.max()
    )
    assert np.all(np.abs(drawn.mean(axis=0) - posterior.draws.mean(axis=0)) < 0.22 * sd)
    assert drawn.std(axis=0) / sd == pytest.approx(np.ones(fit.model.size), abs=0.16)


def test_the_same_seed_gives_the_same_draws(held_phantom):
    etfe, _, fit, _ = held_phantom
    runs = [bh.sample(fit.model, etfe, start=fit, ess=200, seed=seed) for seed in (7, 7, 8)]
    assert np.array_equal(runs[0].chains, runs[1].chains)
    assert not np.array_equal(runs[0].chains, runs[2].chains)
    # Independent ensembles: no two share a draw.
    assert len(np.unique(runs[0].chains[:, -1, :, 0])) > 0.9 * 4 * 64 * 0.4


def test_a_saved_posterior_is_as_good(held_phantom, tmp_path):
    *_, posterior = held_phantom
    with pytest.raises(InputError, match="is a folder; name a file, such as .*posterior.nc"):
        posterior.save(tmp_path)
    with pytest.raises(InputError, match="none: no such folder; make it first"):
        posterior.save(tmp_path / "none" / "posterior.nc")
    path = posterior.save(tmp_path / "posterior.nc")
    assert [p.name for p in tmp_path.iterdir()] == ["posterior.nc"]
    again = bh.load_posterior(path)
    assert again.model.names == posterior.names
    assert np.allclose(again.chains, posterior.chains)
    assert bh.critical_stiffness(again).value == bh.critical_stiffness(posterior).value
    data = posterior.to_arviz()
    assert data["posterior"]["kc"].attrs["units"] == "N m/rad"
    groups = (
        {name.strip("/") for name in (getattr(data, "groups", None) or data.children)}
        if not (callable(getattr(data, "groups", None)))
        else set(data.groups())
    )
    wanted = {"posterior", "prior", "log_likelihood", "observed_data", "posterior_predictive"}
    wanted |= {"prior_predictive"}
    assert wanted <= groups
    # ArviZ weighs the one by the other (plot_loo_pit).
    weighed, predicted = (data[name].sizes for name in ("log_likelihood", "posterior_predictive"))
    assert weighed["chain"] == predicted["chain"] and weighed["draw"] == predicted["draw"]
    assert weighed["window"] == predicted["frequency"]
    az = import_arviz()
    assert float(az.ess(data["posterior"]["kc"].values)) > 1000
    file = az.from_netcdf(path)
    for name in groups - {"/"}:
        there, here = file[name], data[name]
        assert there.equals(here) and sorted(there.coords) == sorted(here.coords)
        assert there.attrs == here.attrs


def test_what_is_no_posterior_is_refused(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        bh.load_posterior(tmp_path / "nothing.nc")
    other = tmp_path / "other.nc"
    other.write_text("text")
    with pytest.raises(InputError, match="not a posterior"):
        bh.load_posterior(other)


@pytest.mark.parametrize(
    ("device", "held", "name"), [("lhifam", True, "grasped"), ("phantom", False, "free")]
)
def test_the_model_is_chosen_from_the_data(device, held, name):
    etfe, _ = measured(device, held, seed=4)
    choice = choose_model(etfe, bh.load_device(device))
    assert choice.fit.model.name == name
    assert "BIC" in choice.reason


@pytest.mark.parametrize(
    "prior",
    [
        LogNormal(0.2, 0.5),
        HalfNormal(3.0),
        NearZero(3.0, 0.1),
        Normal(1.0, 2.0, low=0.0),
        Uniform(-1.0, 4.0),
        LogUniform(0.1, 20.0),
    ],
)
def test_priors_are_densities_that_their_draws_follow(prior):
    low, high = prior.quantile([1e-9, 1 - 1e-9])
    grid = np.linspace(low, high, 400_001)
    density = np.exp(prior.log_density(grid))
    below = np.concatenate([[0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
    assert below[-1] == pytest.approx(1.0, abs=1e-3)
    x = draw(prior, np.random.default_rng(0), 20_000)
    ranks = np.sort(np.interp(x, grid, below))
    # Kolmogorov-Smirnov at 1e-3: 1.95 / sqrt(n).
    assert np.abs(ranks - np.arange(1, 20_001) / 20_000).max() < 1.95 / np.sqrt(20_000)


def test_a_mixture_is_the_density_of_its_draws():
    rng = np.random.default_rng(2)
    one = student(np.array([1.0, -2.0]), np.array([[1.0, 0.9], [0.9, 1.0]]), 8.0)
    other = student(np.array([6.0, 3.0]), 0.3 * np.eye(2), 8.0)
    both = one.with_component(other, 0.3)
    x = both.sample(rng, 40_000)
    # Importance weights from a wide normal integrate the density to one.
    wide = rng.normal(size=(200_000, 2)) * 8 + [3, 0]
    log_wide = -0.5 * np.sum(((wide - [3, 0]) / 8) ** 2, axis=1) - np.log(2 * np.pi * 64)
    weights = np.exp(both.log_density(wide) - log_wide)
    assert weights.mean() == pytest.approx(1.0, abs=5 * weights.std() / np.sqrt(len(weights)))
    fitted = fit_student_mixture(x, np.ones(len(x)), 2, 8.0, rng)
    assert np.sort(fitted.weights) == pytest.approx([0.3, 0.7], abs=0.03)


def test_arviz_is_imported_where_nobody_may_write_that_it_was_advertised(tmp_path) -> None:
    """As where two processes write it at once: a file stands where the folder is to be."""
    (tmp_path / "arviz").write_text("")
    code = (
        "from bayeshaptic.inference.saved.arviz_groups import import_arviz; import os; "
        "print(import_arviz().__name__, os.environ['XDG_CACHE_HOME'])"
    )
    there = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], env=there, capture_output=True, text=True, check=False
    )
    assert done.stdout.split() == ["arviz", str(tmp_path)], done.stderr
