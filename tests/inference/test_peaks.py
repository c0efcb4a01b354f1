"""Posteriors of more than one peak: devices that fit a recording as well as the true one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from on_the_bench import usual_noise

import bayeshaptic as bh
from bayeshaptic.inference.sampling.ensembles import joined, warmed_up
from bayeshaptic.inference.sampling.several_peaks import SeveralPeaks, covered, log_held, restored
from bayeshaptic.numerics.mixture import student
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.types import Floats

# Two normal distributions in the plane, the second with 0.3 of the probability, in one of which the
# ridge is bent: (x, y - BEND x^2) is normal.
SHARE = 0.3
FAR = np.array([40.0, 10.0])
SMALL, BEND = 0.5, 0.3


def two_peaks(x: Floats) -> Floats:
    x = np.atleast_2d(x)
    first = -0.5 * (x[:, 0] ** 2 + ((x[:, 1] - BEND * x[:, 0] ** 2) / SMALL) ** 2) - np.log(SMALL)
    second = -0.5 * np.sum((x - FAR) ** 2, axis=1)
    return np.logaddexp(np.log(1 - SHARE) + first, np.log(SHARE) + second) - np.log(2 * np.pi)


@pytest.fixture(scope="module")
def about():
    seeds = np.random.SeedSequence(4).spawn(2)
    starts = (np.zeros(2), np.eye(2)), (FAR, np.eye(2))
    return [
        warmed_up(two_peaks, student(mean, spread), seed, mean)
        for seed, (mean, spread) in zip(seeds, starts, strict=True)
    ]


def test_each_peak_holds_its_share(about):
    """By 1,000 weighted draws; the weights of proposals that fit scatter by less than one."""
    held = [log_held(two_peaks, one.proposal) for one in about]
    assert np.exp(held) == pytest.approx([1 - SHARE, SHARE], rel=4 / np.sqrt(1000))


def test_draws_over_both_peaks_have_their_shares(about):
    held = np.log([0.5, 0.5])  # walkers begin with shares that are wrong, and proposals, too
    ensembles = joined(two_peaks, about, held, np.random.SeedSequence(5))
    chains, _ = ensembles.advance(400)
    late = chains[:, 100:]
    x, y = late[..., 0], late[..., 1]
    close = x < 20
    for value, truth in (
        (1.0 * ~close, SHARE),
        (close * x**2, 1 - SHARE),
        (close * (y - BEND * x**2) ** 2, (1 - SHARE) * SMALL**2),
    ):
        found = value.mean(axis=1)  # of each walker, which are independent of one another
        error = found.std() / np.sqrt(found.size)
        assert error < 0.05 * truth and abs(found.mean() - truth) < 4 * error


def test_the_density_of_what_is_proposed_is_one_in_all(about):
    """Over the plane: weighted by a normal density around each peak, as wide as both."""
    proposal = SeveralPeaks.of(tuple(one.proposal for one in about), np.log([0.7, 0.3]))
    rng = np.random.default_rng(6)
    wide = student(np.zeros(2), np.diag([9.0, 25.0]), 5.0)
    wide = wide.with_component(student(FAR, 9.0 * np.eye(2), 5.0), 0.5)
    points = wide.sample(rng, 40_000)
    ratio = np.exp(proposal.log_density(points) - wide.log_density(points))
    assert ratio.mean() == pytest.approx(1.0, abs=4 * ratio.std() / 200)


def test_shares_of_peaks_are_one_in_all_however_large_the_likelihood(about):
    """Of a table with known standard deviations log likelihoods are 1e9, and draws were refused."""
    for log_likelihood in (0.0, -6e9, 3.3e10):
        held = log_likelihood + np.array([0.0, -0.75])
        weights = SeveralPeaks.of(tuple(one.proposal for one in about), held).weights
        assert weights.sum() == pytest.approx(1.0, abs=1e-14)
        assert weights[0] == pytest.approx(0.05 + 0.9 / (1 + np.exp(-0.75)), abs=1e-5)


def test_a_checkpoint_keeps_all_peaks(about):
    proposal = SeveralPeaks.of(tuple(one.proposal for one in about), np.log([0.7, 0.3]))
    again = restored(proposal.to_arrays())
    points = np.array([[0.1, 0.2], [39.0, 10.0], [1.5, 0.7]])
    assert isinstance(again, SeveralPeaks)
    assert np.array_equal(again.log_density(points), proposal.log_density(points))
    one = restored(about[0].proposal.to_arrays())
    assert np.array_equal(covered(one, points), [True, False, True])


# A PHANToM with its parameters changed by factors of two: seed 6 of eight drawn so.
SWAPPED = {"m1": 0.00188, "b1": 0.236, "bc": 0.00109, "kc": 16.2, "m2": 0.00214, "b2": 0}
SWAPPED |= {"bs": 0.0287, "ks": 175, "mh": 0.00396, "bh": 0.154, "kh": 1.64}


@pytest.fixture(scope="module")
def held():
    bench = Bench.from_device("phantom", held=True, values=SWAPPED)
    noise = usual_noise(bench, 12.0)
    recording = bh.recording_from_arrays(**simulate(bench, noise, seed=6).signals)
    etfe = bh.estimate_etfe(recording)
    model = bh.grasped(delay_s=bench.delay_s, period_s=bench.period_s)
    one_set = bh.least_squares(model, etfe, most_sets=1)  # others may end in the better valley
    return etfe, one_set, bench.true_critical_stiffness()


def test_a_fit_tells_what_else_fits_as_well(held):
    _, fit, _ = held
    found = fit.likelihood(fit.alike)
    assert len(fit.alike) > 1 and found.max() > fit.log_likelihood - 5


def test_masses_that_swap_their_parts_are_both_in_the_posterior(held):
    """About one peak alone the limit is known better than it is, and lies beside the truth."""
    etfe, fit, truth = held
    alone = replace(fit, alike=fit.alike[:0])
    low, high = bh.critical_stiffness(
        bh.sample(fit.model, etfe, start=alone, ess=200, seed=1)
    ).quantile([0.001, 0.999])
    assert not low < truth < high
    posterior = bh.sample(fit.model, etfe, start=fit, ess=200, seed=1)
    low, high = bh.critical_stiffness(posterior).quantile([0.001, 0.999])
    assert posterior.converged and low < truth < high


def test_a_posterior_is_of_the_model_and_the_data_that_are_asked_for(held):
    """Also where it begins at a fit of others."""
    recording = bh.recording_from_arrays(
        **simulate(Bench.from_device("lhifam"), WhiteNoise(4.0, 300.0, 0.3, 5.0), seed=1).signals
    )
    softer = replace(recording, position=2 * recording.position)
    etfe, twice = bh.estimate_etfe(recording), bh.estimate_etfe(softer)
    model = bh.free(device="lhifam")
    fit = bh.least_squares(model, etfe)
    own = bh.critical_stiffness(bh.sample(model, etfe, start=fit, ess=100)).quantile(0.5)
    half = bh.critical_stiffness(bh.sample(model, twice, start=fit, ess=100)).quantile(0.5)
    assert half == pytest.approx(own / 2, rel=0.1)
    heavy = model.with_prior({"m1": bh.LogNormal(0.3, 1e-5)})
    draws = bh.sample(heavy, etfe, start=fit, ess=100)
    assert draws.summary()["m1"]["mean"] == pytest.approx(0.3, rel=1e-3)
