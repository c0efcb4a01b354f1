"""Users from recordings of the bench, against sampling all levels with the exact likelihoods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.random import SeedSequence
from toy_study import toy_model

import bayeshaptic as bh
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.population.cavity import cavity
from bayeshaptic.inference.population.gaussian_likelihood import described, linearised
from bayeshaptic.inference.population.hyperparameters import Unknowns
from bayeshaptic.inference.population.infer import (
    infer_population,
    prior_moments,
    study_coordinates,
)
from bayeshaptic.inference.population.reweighting import Wanted, from_own, sampled
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.rig import Bench, simulate
from bayeshaptic.types import Floats

HANDS = ((0.0, 0.0), (0.35, -0.2), (-0.3, 0.25))  # log ks and log mh beside the paper's


@pytest.fixture(scope="module")
def posteriors() -> list[Posterior]:
    """Three people on one PHANToM; kc, ks and mh are inferred, the rest is known."""
    found = []
    model = toy_model("kc", "ks", "mh")
    for number, (ks, mh) in enumerate(HANDS):
        bench = Bench.from_device("phantom", held=True)
        values = dict(bench.values)
        values["ks"] *= float(np.exp(ks))
        values["mh"] *= float(np.exp(mh))
        done = simulate(replace(bench, values=values), seed=number)
        recording = bh.recording_from_arrays(**done.signals)
        etfe = bh.estimate_etfe(recording)
        fit = bh.least_squares(model, etfe, seed=1)
        found.append(bh.sample(model, etfe, fit, ess=200, seed=1))
    return found


def test_linearised_likelihood_is_that_of_the_model(posteriors: list[Posterior]) -> None:
    posterior = posteriors[0]
    here = study_coordinates(posterior.model)
    x = here.coordinate(posterior.draws)
    found = linearised(posterior, here, x.mean(axis=0), 0.05 * x.std(axis=0))
    assert found is not None
    left = posterior.log_likelihood.ravel() - found(x)
    assert left.std() < 0.1  # nats; the likelihood itself varies by more than 1
    bare = replace(posterior, windows=None)
    assert linearised(bare, here, x.mean(axis=0), x.std(axis=0)) is None
    assert described(bare, here, posterior.draws) is None


def test_a_description_does_not_depend_on_the_draws_that_it_was_made_of(
    posteriors: list[Posterior],
) -> None:
    here = study_coordinates(posteriors[0].model)
    found = infer_population(posteriors, ["ana", "ben", "eva"], seed=1)
    assert found._hierarchy is not None and found.chains is not None
    phi, _ = found.chains.in_order(2000)
    peaks, widths = [], []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        rest = cavity(found._hierarchy, 1, phi, rng)
        exact = sampled(Wanted(posteriors[1], "ben", here, 4000, rng), rest, SeedSequence(seed))
        assert exact is not None
        description = described(posteriors[1], here, exact.draws)
        assert description is not None
        peaks.append(description.mean)
        widths.append(np.sqrt(np.diag(description.covariance)))
    assert np.all(np.ptp(peaks, axis=0) < 0.1 * np.mean(widths, axis=0))
    np.testing.assert_allclose(widths, np.tile(np.mean(widths, axis=0), (3, 1)), rtol=0.1)


def joint_draws(posteriors: list[Posterior]) -> tuple[Floats, Floats]:
    """Mean hand and log sd (n, 4), and every recording's coordinates (n, R, 3), all together."""
    import emcee

    model = posteriors[0].model
    here, layout = study_coordinates(model), Unknowns(2, 1, False)
    mean, sd = prior_moments(model, here)
    hand = [model.names.index(name) for name in ("ks", "mh")]
    device = model.names.index("kc")
    likelihoods = [Likelihood(p.model, p.windows) for p in posteriors if p.windows is not None]

    def unpack(p: Floats) -> Floats:
        x = np.empty((len(p), 3, 3))
        x[:, :, hand] = p[:, 7:13].reshape(-1, 3, 2)
        x[:, :, device] = p[:, [6]] + np.exp(p[:, [3]]) * p[:, 13:]
        return x

    def log_density(p: Floats) -> Floats:
        level, mu = layout.read(p[:, :4]), p[:, 4:6]
        x = unpack(p)
        value = level.log_prior - 0.5 * np.sum(p[:, 13:] ** 2, axis=1)
        beta = p[:, 4:7] - mean[[*hand, device]]
        value -= 0.5 * np.sum((beta / sd[[*hand, device]]) ** 2, axis=1)
        root = level.hand_sd[:, :, None] * level.correlation_root
        off = (x[:, :, hand] - mu[:, None]).transpose(0, 2, 1)
        value -= 0.5 * np.sum(np.linalg.solve(root, off) ** 2, axis=(1, 2))
        value -= 3 * np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        for r, likelihood in enumerate(likelihoods):
            value += likelihood(here.natural(x[:, r]))
        return np.asarray(value)

    rng = np.random.default_rng(3)
    seen = np.stack([here.coordinate(p.draws).mean(axis=0) for p in posteriors])
    widths = np.stack([here.coordinate(p.draws).std(axis=0) for p in posteriors])
    middle = np.concatenate(
        [[-1.0, -1.0, 0.0, -7.5], seen[:, hand].mean(axis=0), [seen[:, device].mean()]]
        + [seen[:, hand].ravel(), np.zeros(3)]
    )
    width = np.concatenate(
        [[0.2, 0.2, 0.2, 0.5, 0.05, 0.05, widths[:, device].min()]]
        + [widths[:, hand].ravel(), np.ones(3)]
    )
    sampler = emcee.EnsembleSampler(
        64, 16, log_density, vectorize=True,
        moves=[(emcee.moves.DEMove(), 0.7), (emcee.moves.StretchMove(), 0.3)],
    )  # fmt: skip
    sampler.random_state = np.random.RandomState(4).get_state()
    sampler.run_mcmc(middle + 0.5 * width * rng.standard_normal((64, 16)), 2500)
    chain = np.asarray(sampler.get_chain(discard=500, flat=True, thin=10))
    return np.column_stack([chain[:, 4:6], chain[:, :2]]), unpack(chain)


def test_against_sampling_all_levels(posteriors: list[Posterior]) -> None:
    here = study_coordinates(posteriors[0].model)
    fast = infer_population(posteriors, ["ana", "ben", "eva"], seed=1)
    assert fast.parameters == ("ks", "mh")
    slow, slow_own = joint_draws(posteriors)
    found = np.column_stack([fast.log_mean, np.log(fast.log_sd)])
    scale = slow.std(axis=0)
    # Some 500 effective draws on either side: 0.06 standard deviations of a difference of means.
    assert np.all(np.abs(found.mean(axis=0) - slow.mean(axis=0)) < 0.25 * scale)
    np.testing.assert_allclose(found.std(axis=0), scale, rtol=0.25)
    for r, own in enumerate(fast.recordings):
        x = here.coordinate(own.draws)
        spread = slow_own[:, r].std(axis=0)
        assert np.all(np.abs(x.mean(axis=0) - slow_own[:, r].mean(axis=0)) < 0.25 * spread)
        np.testing.assert_allclose(x.std(axis=0), spread, rtol=0.25)
        assert own.effective > 1000


def test_all_ways_to_one_recording_agree(posteriors: list[Posterior]) -> None:
    here = study_coordinates(posteriors[0].model)
    found = infer_population(posteriors, ["ana", "ben", "eva"], seed=1)
    assert found._hierarchy is not None and found.chains is not None
    phi, _ = found.chains.in_order(2000)
    rng = np.random.default_rng(5)
    rest = cavity(found._hierarchy, 1, phi, rng)
    wanted = Wanted(posteriors[1], "ben", here, 4000, rng)
    ways = [found.recordings[1], from_own(wanted, rest)]
    exact = sampled(wanted, rest, SeedSequence(6))
    assert exact is not None and exact.good
    x = here.coordinate(exact.draws)
    for way in ways:
        other = here.coordinate(way.draws)
        # A thousand effective draws: 0.04 standard deviations of a difference of means.
        assert np.all(np.abs(other.mean(axis=0) - x.mean(axis=0)) < 0.2 * x.std(axis=0))
        np.testing.assert_allclose(other.std(axis=0), x.std(axis=0), rtol=0.2)
