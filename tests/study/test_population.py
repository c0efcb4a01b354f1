"""Users: the levels of a study against slow references, and what is said of people not yet seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from toy_study import toy_model, toy_posterior

import bayeshaptic as bh
from bayeshaptic.errors import InputError
from bayeshaptic.inference.population import settling
from bayeshaptic.inference.population.below import draw_below
from bayeshaptic.inference.population.cavity import Cavity, cavity
from bayeshaptic.inference.population.gaussian_likelihood import GaussianLikelihood, fit_quadratic
from bayeshaptic.inference.population.hierarchy import Hierarchy, inverse_and_log_det
from bayeshaptic.inference.population.hyperparameters import LKJ, Unknowns
from bayeshaptic.inference.population.infer import (
    _notices,
    infer_population,
    prior_moments,
    study_coordinates,
)
from bayeshaptic.inference.population.population import Population
from bayeshaptic.inference.population.sampler import sample_level
from bayeshaptic.inference.population.walkers import Walkers
from bayeshaptic.inference.sampling.ensembles import Ensembles
from bayeshaptic.inference.sampling.proposal import Proposal
from bayeshaptic.numerics.mixture import student
from bayeshaptic.numerics.pareto import pareto_k
from bayeshaptic.types import Floats


def quadratic(mean: Floats, covariance: Floats, seed: int = 0) -> object:
    rng = np.random.default_rng(seed)
    x = rng.multivariate_normal(mean, covariance, size=300)
    off = x - mean
    values = 3.0 - 0.5 * np.einsum("bi,ij,bj->b", off, np.linalg.inv(covariance), off)
    return fit_quadratic(x, values)


def random_covariance(rng: np.random.Generator, size: int, sd: float) -> Floats:
    root = rng.standard_normal((size, size + 2)) * sd
    return root @ root.T / size


def test_a_gaussian_likelihood_is_found_again() -> None:
    rng = np.random.default_rng(1)
    mean, covariance = rng.standard_normal(4), random_covariance(rng, 4, 0.1)
    found = quadratic(mean, covariance)
    np.testing.assert_allclose(found.mean, mean, atol=1e-9)  # type: ignore[attr-defined]
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-6, atol=1e-9)  # type: ignore[attr-defined]
    assert found.constant == pytest.approx(3.0)  # type: ignore[attr-defined]


def dense_log_density(levels: Hierarchy, phi: Floats) -> float:
    """The marginal likelihood from the covariance of everything seen, one big normal density."""
    level = levels.layout.read(phi[None])
    root = level.hand_sd[0][:, None] * level.correlation_root[0]
    size, count = len(levels.prior_mean), len(levels.user)
    whole = np.zeros((count * size, count * size))
    for r in range(count):
        for q in range(count):
            block = levels.design[r] @ np.diag(levels.beta_sd**2) @ levels.design[q].T
            if levels.user[r] == levels.user[q]:
                block[np.ix_(levels.hand, levels.hand)] += root @ root.T
            if r == q:
                block += levels.likelihoods[r].covariance + np.diag(levels.spread(level)[0])
            whole[r * size : (r + 1) * size, q * size : (q + 1) * size] = block
    seen = levels.mean.ravel()
    value = -0.5 * np.linalg.slogdet(whole)[1] - 0.5 * seen @ np.linalg.solve(whole, seen)
    return float(value + level.log_prior[0])


def test_integrals_against_one_big_normal_density() -> None:
    rng = np.random.default_rng(2)
    size, user, place = 5, np.array([0, 0, 1, 2, 2]), np.array([0, 1, 0, 1, 0])
    levels = Hierarchy(
        tuple(
            quadratic(0.3 * rng.standard_normal(size), random_covariance(rng, size, 0.05), n)  # type: ignore[misc]
            for n in range(5)
        ),
        user,
        place,
        np.array([1, 3, 4]),
        np.array([0, 2]),
        0.1 * rng.standard_normal(size),
        np.array([0.5, 0.7, 0.5, 0.7, 0.7]),
    )
    middle, width = levels.guess()
    phi = middle + 0.5 * width * rng.standard_normal((6, len(middle)))
    fast = levels.log_density(phi)
    slow = np.array([dense_log_density(levels, one) for one in phi])
    np.testing.assert_allclose(fast - fast[0], slow - slow[0], rtol=1e-7, atol=1e-6)


def test_correlations_have_the_density_that_they_should() -> None:
    layout = Unknowns(3, 0, False)
    rng = np.random.default_rng(3)
    partial = 0.6 * rng.standard_normal((4, 3))
    phi = np.concatenate([np.zeros((4, 3)), partial], axis=1)

    def correlation(z: Floats) -> Floats:
        root = layout.read(np.concatenate([np.zeros(3), z])[None]).correlation_root[0]
        return np.asarray((root @ root.T)[np.tril_indices(3, -1)])

    # LKJ: det(C)^(LKJ - 1), times the Jacobian of the map, by differences.
    expected = []
    for z in partial:
        steps = [(correlation(z + h) - correlation(z - h)) / 2e-5 for h in 1e-5 * np.eye(3)]
        lower = correlation(z)
        full = np.eye(3)
        full[np.tril_indices(3, -1)] = lower
        full = full + full.T - np.eye(3)
        jacobian = np.linalg.slogdet(np.array(steps))[1]
        expected.append((LKJ - 1) * np.linalg.slogdet(full)[1] + jacobian)
    found = layout.read(phi).log_prior
    np.testing.assert_allclose(found - found[0], np.array(expected) - expected[0], atol=1e-6)


def direct_draws(means: Floats, covariances: Floats, prior: tuple[Floats, Floats]) -> Floats:
    """mu, log sd, device, log spread by sampling them with every recording's own parameters.

    One hand's parameter and one of the device; x_r = (mu + sd v_r, device + spread t_r).
    """
    import emcee

    count = len(means)
    weight = np.linalg.inv(covariances)

    def log_density(p: Floats) -> Floats:
        mu, log_sd, device, log_spread = p[:, :4].T
        v, t = p[:, 4 : 4 + count], p[:, 4 + count :]
        x = np.stack(
            [
                mu[:, None] + np.exp(log_sd)[:, None] * v,
                device[:, None] + np.exp(log_spread)[:, None] * t,
            ],
            axis=2,
        )
        off = x - means
        value = -0.5 * np.einsum("bri,rij,brj->b", off, weight, off)
        value -= 0.5 * np.sum(v**2, axis=1) + 0.5 * np.sum(t**2, axis=1)
        value += log_sd - 0.5 * (np.exp(log_sd) / 0.7) ** 2
        value -= 0.5 * ((log_spread - np.log(0.003)) / 1.5) ** 2
        value -= 0.5 * ((mu - prior[0][0]) / prior[1][0]) ** 2
        value -= 0.5 * ((device - prior[0][1]) / prior[1][1]) ** 2
        return np.asarray(value)

    rng = np.random.default_rng(4)
    middle = np.concatenate(
        [[means[:, 0].mean(), -1.0, means[:, 1].mean(), -6.0], np.zeros(2 * count)]
    )
    width = np.concatenate([[0.1, 0.2, 0.003, 1.0], np.ones(2 * count)])
    start = middle + width * rng.standard_normal((80, len(middle)))
    sampler = emcee.EnsembleSampler(
        80,
        len(middle),
        log_density,
        vectorize=True,
        moves=[(emcee.moves.DEMove(), 0.8), (emcee.moves.StretchMove(), 0.2)],
    )
    sampler.random_state = np.random.RandomState(5).get_state()
    sampler.run_mcmc(start, 6000)
    return np.asarray(sampler.get_chain(discard=1000, flat=True, thin=20))[:, :4]


def test_against_sampling_everything_together() -> None:
    model = toy_model("kc", "kh")  # device, hand
    mean, sd = prior_moments(model, study_coordinates(model))
    rng = np.random.default_rng(6)
    truth = mean + np.array([0.02, 0.1])
    covariance = np.array([[4e-5, 1.2e-4], [1.2e-4, 1e-3]])
    means = truth + np.column_stack([np.zeros(5), 0.3 * rng.standard_normal(5)])
    means += rng.multivariate_normal(np.zeros(2), covariance, size=5)
    posteriors = [toy_posterior(model, one, covariance, n) for n, one in enumerate(means)]
    found = infer_population(posteriors, list("abcde"), seed=1)
    order = [1, 0]  # the hand first, there
    turned = covariance[np.ix_(order, order)]
    slow = direct_draws(means[:, order], np.tile(turned, (5, 1, 1)), (mean[order], sd[order]))
    assert found._below is not None
    fast = np.column_stack(
        [
            found.log_mean[:, 0],
            np.log(found.log_sd[:, 0]),
            found._below.beta[:, 1],
            np.log(found.device_spread[:, 0]),
        ]
    )
    scale = slow.std(axis=0)
    # 500 effective draws: an error of 0.045 sd of a mean, three times that for two chains.
    assert np.all(np.abs(fast.mean(axis=0) - slow.mean(axis=0)) < 0.2 * scale)
    np.testing.assert_allclose(fast.std(axis=0), scale, rtol=0.2)


def test_a_damper_that_the_device_lacks_is_in_none_of_its_recordings() -> None:
    rng = np.random.default_rng(8)
    sd, count, draws = 0.3, 8, 4000
    means = np.array([[0.0, 5.0, 1.0]]) + sd * rng.standard_normal((count, 3))
    own = np.diag([sd**2] * 3)
    own[0, 1] = own[1, 0] = -0.9 * sd**2  # a sum of dampers is known better than either
    levels = Hierarchy(
        [GaussianLikelihood(one, np.linalg.inv(own), own, 0.0) for one in means],
        np.arange(count),
        np.zeros(count, int),
        np.array([2]),
        np.array([0, 1]),
        np.zeros(3),
        np.full(3, 100.0),
    )
    phi = np.tile(levels.layout.guess(np.ones(1))[0], (draws, 1))
    low, spike = np.array([0.0, 0.0, -np.inf]), np.array([3.0, 3.0, 0.0])
    found = draw_below(levels, phi, low, rng, spike)
    zero = found.beta[:, 1] == 0.0
    seen, error = means[:, 0].mean(), sd / np.sqrt(count)
    odds = 3.0 * norm.pdf(seen / error) / norm.cdf(seen / error)
    # The spread between recordings, 0.15 %, adds next to nothing to the error.
    assert zero.mean() == pytest.approx(odds / (1 + odds), abs=0.04)
    assert np.all((found.recordings[:, :, 0] == 0.0) == zero[:, None])
    assert not np.any(found.beta[:, 2] == 0.0)
    # What a recording knows is the sum: the other damper has what this one has not.
    whole = found.recordings[:, :, :2].sum(axis=2)
    assert whole[zero].mean() == pytest.approx(whole[~zero].mean(), abs=0.02)


@pytest.mark.parametrize("seen", [0.02, 0.3, 1.0])
def test_a_wall_that_a_recording_rules_out_is_not_drawn(seen: float) -> None:
    """One recording of a damper whose scatter between recordings is as large as its error.

    The odds of a device at the wall are asked for of one whose recordings scatter about it.  That
    this recording is at the wall, too, is then as probable as its density there beside that before.
    """
    sd, scatter, weight, draws = 0.1, 0.1, 30.0, 4000
    own = np.diag([sd**2] * 2)
    levels = Hierarchy(
        [GaussianLikelihood(np.array([seen, 1.0]), np.linalg.inv(own), own, 0.0)],
        np.zeros(1, int),
        np.zeros(1, int),
        np.array([1]),
        np.array([0]),
        np.zeros(2),
        np.full(2, 100.0),
    )
    phi = levels.layout.guess(np.ones(1))[0]
    phi[-1] = np.log(scatter)
    low, spike = np.array([0.0, -np.inf]), np.array([weight, 0.0])
    found = draw_below(levels, np.tile(phi, (draws, 1)), low, np.random.default_rng(9), spike)
    zero = found.beta[:, 1] == 0.0
    far = seen / np.hypot(sd, scatter)
    odds = weight * norm.pdf(far) / norm.cdf(far)
    middle, left = seen * scatter**2 / (scatter**2 + sd**2), scatter * sd / np.hypot(scatter, sd)
    odds *= min(norm.pdf(middle / left) / left * scatter / norm.pdf(0.0), 1.0)
    assert zero.mean() == pytest.approx(odds / (1 + odds), abs=0.03)
    x = found.recordings[:, 0, 0]
    assert np.all((x == 0.0) == zero)
    # Where it is not at the wall it is what the recording says, beside a scatter about more than 0.
    assert zero.mean() > 0.9 or x[~zero].mean() > 0.5 * seen


def test_units_of_dampers_do_not_depend_on_how_wide_nobodys_knowledge_is() -> None:
    model = toy_model("b1", "kh")
    known = toy_posterior(model, study_coordinates(model).coordinate(model.values[None])[0],
                          0.01 * np.eye(2), 3)  # fmt: skip
    units = []
    for scale in (0.1, 100.0):
        wide = model.with_prior({"b1": bh.MaybeZero(scale)})
        here = study_coordinates(wide, [replace(known, model=wide)] * 2)
        units.append(here.scale[model.names.index("b1")])
        assert prior_moments(wide, here)[1][model.names.index("b1")] * units[-1] == scale
    assert units[0] == units[1]
    assert units[0] == pytest.approx(
        study_coordinates(model).scale[model.names.index("b1")], rel=0.1
    )


@pytest.fixture(scope="module")
def people() -> tuple[Population, Floats, Floats]:
    """Ten users of whom the last was recorded badly: population, their hands, and their peaks."""
    model = toy_model("kc", "b1", "mh", "kh")
    here = study_coordinates(model)
    names = list(model.names)
    rng = np.random.default_rng(7)
    mean, _ = prior_moments(model, here)
    x = np.tile(mean, (10, 1))
    hand = [names.index("mh"), names.index("kh")]
    x[:, hand] += rng.multivariate_normal([0.1, -0.1], [[0.09, 0.05], [0.05, 0.09]], size=10)
    x[:, names.index("b1")] = 0.01  # nearly none, in units of the prior's width
    peaks, posteriors = [], []
    for number, one in enumerate(x):
        noise = random_covariance(rng, 4, 0.02 if number < 9 else 0.5)
        peaks.append(rng.multivariate_normal(one, noise))
        posteriors.append(toy_posterior(model, peaks[-1], noise, number))
    found = infer_population(posteriors, [f"user {n}" for n in range(10)], seed=2)
    return found, x[:, hand], np.array(peaks)[:, hand]


def test_population_mean_and_correlation(people: tuple[Population, Floats, Floats]) -> None:
    found, hands, _ = people
    assert found.parameters == ("mh", "kh") and found.device_parameters == ("b1", "kc")
    middle = np.log([toy_model("mh", "kh").reference[name] for name in found.parameters])
    truth = middle + np.array([0.1, -0.1])
    off = (found.log_mean.mean(axis=0) - truth) / found.log_mean.std(axis=0)
    assert np.all(np.abs(off) < 3)
    assert np.quantile(found.correlation[:, 0, 1], 0.95) > np.corrcoef(hands.T)[0, 1]


def test_a_poor_recording_is_drawn_to_the_others(people: tuple[Population, Floats, Floats]) -> None:
    found, hands, peaks = people
    columns = [found.model.names.index(name) for name in found.parameters]
    own = np.log(found.of_user("user 9")[0].draws[:, columns]).mean(axis=0)
    centre = found.log_mean.mean(axis=0)
    assert np.linalg.norm(own - centre) < np.linalg.norm(peaks[9] - centre)
    good = np.log(found.of_user("user 0")[0].draws[:, columns])
    assert np.all(np.abs(good.mean(axis=0) - hands[0]) < 4 * good.std(axis=0))


def test_new_people(people: tuple[Population, Floats, Floats]) -> None:
    found, hands, _ = people
    draws = found.new_person(np.random.default_rng(1), each=5)
    assert draws.shape == (5 * len(found.log_mean), 4)
    assert np.all(draws >= 0)  # no damper below its wall
    same = found.new_person(np.random.default_rng(1), each=5)
    np.testing.assert_array_equal(draws, same)
    # As the ten that were seen, and wider, because mean and spread are not known.
    own = np.log(draws[:, [found.model.names.index(name) for name in found.parameters]])
    width = np.ptp(np.quantile(own, [0.05, 0.95], axis=0), axis=0)
    plain = 2 * 1.645 * hands.std(axis=0, ddof=1)
    assert np.all((width > plain) & (width < 1.5 * plain))


def test_two_trials_of_one_person() -> None:
    model = toy_model("kc", "kh")
    mean, _ = prior_moments(model, study_coordinates(model))
    noise = np.diag([1e-6, 1e-4])
    off = (0.3, -0.2, 0.1, -0.4, 0.2)
    posteriors, users = [], []
    for number, one in enumerate(off):
        for trial in range(2):
            peak = mean + np.array([0.0, one + 0.01 * (-1) ** trial])
            posteriors.append(toy_posterior(model, peak, noise, 2 * number + trial))
            users.append(f"user {number}")
    found = infer_population(posteriors, users, seed=3)
    assert found.users == tuple(dict.fromkeys(users)) and len(found.of_user("user 1")) == 2
    assert found._below is not None
    assert np.median(found._below.level.trial_sd) < 0.1 < np.median(found.log_sd)


def test_models_must_agree_and_have_a_hand() -> None:
    one = toy_posterior(toy_model("kc", "kh"), np.array([3.0, 0.3]), 1e-4 * np.eye(2), 0)
    other = toy_posterior(toy_model("kc", "mh"), np.array([3.0, -6.0]), 1e-4 * np.eye(2), 0)
    with pytest.raises(InputError, match="posterior 2 has the parameters kc, mh"):
        infer_population([one, other], ["a", "b"])
    free = toy_model("kc", base="free")
    with pytest.raises(InputError, match="the free model has no hand"):
        infer_population([toy_posterior(free, np.array([3.0]), 1e-4 * np.eye(1), 0)], ["a"])
    with pytest.raises(InputError, match="1 posteriors, but 2 users"):
        infer_population([one], ["a", "b"])
    with pytest.raises(InputError, match="no recording"):
        infer_population([], [])


def test_the_rest_of_a_study_by_one_big_normal_density() -> None:
    rng = np.random.default_rng(11)
    size, user = 3, np.array([0, 1, 1])
    levels = Hierarchy(
        tuple(
            quadratic(0.3 * rng.standard_normal(size), random_covariance(rng, size, 0.05), n)  # type: ignore[misc]
            for n in range(3)
        ),
        user,
        np.zeros(3, int),
        np.array([0, 2]),
        np.array([1]),
        0.1 * rng.standard_normal(size),
        np.array([0.5, 0.7, 0.5]),
    )
    phi = levels.guess()[0]
    level = levels.layout.read(phi[None])
    root = level.hand_sd[0][:, None] * level.correlation_root[0]
    prior = np.zeros((3, size, 3, size))
    for r in range(3):
        for q in range(3):
            prior[r, :, q] = levels.design[r] @ np.diag(levels.beta_sd**2) @ levels.design[q].T
            if user[r] == user[q]:
                prior[r, :, q][np.ix_(levels.hand, levels.hand)] += root @ root.T
        prior[r, :, r] += np.diag(levels.spread(level)[0])
    flat = prior.reshape(3 * size, 3 * size)
    others = flat[size:, size:].copy()
    for r in (1, 2):
        own = slice((r - 1) * size, r * size)
        others[own, own] += levels.likelihoods[r].covariance
    gain = np.linalg.solve(others, flat[size:, :size]).T
    mean = gain @ levels.mean[1:].ravel() + levels.prior_mean
    covariance = flat[:size, :size] - gain @ flat[size:, :size]
    rest = cavity(levels, 0, phi[None], rng)
    root = np.linalg.inv(rest.whitening[0])
    np.testing.assert_allclose(rest.means[0], mean, atol=1e-4)
    np.testing.assert_allclose(root @ root.T, covariance, rtol=1e-3, atol=1e-6)


def test_walkers_find_a_shoulder() -> None:
    class Level:
        """A normal distribution, and a logarithm that is flat from -6 to 0."""

        def log_density(self, phi: Floats) -> Floats:
            flat = np.where(phi[:, 2] > 0, 0.5 * (phi[:, 2] / 0.1) ** 2, 0.0)
            flat += np.where(phi[:, 2] < -6, 0.5 * ((phi[:, 2] + 6) / 0.1) ** 2, 0.0)
            off = phi[:, :2] @ np.array([[1.0, 0.9], [0.0, 0.5]])
            return np.asarray(-flat - 0.5 * np.sum(off**2, axis=1))

        def guess(self) -> tuple[Floats, Floats]:
            return np.zeros(3), np.ones(3)

    found = sample_level(Level(), np.random.SeedSequence(1))
    assert found.diagnostics.rhat.max() < 1.01 and found.diagnostics.ess >= 500
    x = found.chains.reshape(-1, 3)
    root = np.linalg.inv(np.array([[1.0, 0.9], [0.0, 0.5]]))
    sd = np.append(np.sqrt(np.diag(root.T @ root)), 6 / np.sqrt(12))
    np.testing.assert_allclose(x.std(axis=0), sd, rtol=0.1)
    ordered, walkers = found.in_order(2000)
    assert len(ordered) % walkers == 0 and 1000 < len(ordered) <= 2000
    np.testing.assert_array_equal(ordered[0], found.chains[0, 0, 0])


def test_small_matrices_are_inverted_as_numpy_does() -> None:
    roots = np.random.default_rng(2).standard_normal((3, 7, 6, 12)) * np.logspace(-2, 2, 6)[:, None]
    matrices = roots @ roots.transpose(0, 1, 3, 2)
    found, log_det = inverse_and_log_det(matrices)
    scale = np.logspace(-2, 2, 6)
    whole = (found @ matrices) * scale[:, None] / scale
    np.testing.assert_allclose(whole, np.broadcast_to(np.eye(6), whole.shape), atol=1e-10)
    np.testing.assert_allclose(log_det, np.linalg.slogdet(matrices)[1], rtol=1e-12, atol=1e-12)
    with pytest.raises(np.linalg.LinAlgError):
        inverse_and_log_det(matrices * np.where(np.arange(7) == 3, -1.0, 1.0)[:, None, None])


def test_what_recordings_say_is_summed_as_numpy_does() -> None:
    """Of 13 spreads (no whole number of lanes), three users, two configurations."""
    rng = np.random.default_rng(3)
    roots = rng.standard_normal((5, 4, 9))
    covariance, mean = roots @ roots.transpose(0, 2, 1), rng.standard_normal((5, 4))
    likelihoods = tuple(
        GaussianLikelihood(m, np.linalg.inv(v), v, 0.0)
        for m, v in zip(mean, covariance, strict=True)
    )
    user, place = np.array([0, 0, 1, 2, 2]), np.array([0, 1, 0, 0, 1])
    hand, device = np.array([1, 3]), np.array([0, 2])
    level = Hierarchy(likelihoods, user, place, hand, device, np.zeros(4), np.ones(4))
    spread = rng.uniform(0.1, 2.0, (13, 4))
    weight = np.linalg.inv(covariance + spread[:, None, :, None] * np.eye(4))
    np.testing.assert_allclose(level.weight(spread), weight, atol=1e-12)
    pull, seen = np.einsum("brij,rj->bri", weight, mean), weight @ level.design
    members = np.equal.outer(np.arange(3), user).astype(float)
    plain = (
        np.einsum("rip,briq->bpq", level.design, seen),
        np.einsum("rip,bri->bp", level.design, pull),
        np.einsum("bri,ri->b", pull, mean),
        -np.linalg.slogdet(weight)[1].sum(axis=1),
        np.einsum("ur,brij->buij", members, weight[:, :, hand][..., hand]),
        np.einsum("ur,bri->bui", members, pull[..., hand]),
        np.einsum("ur,briq->buiq", members, seen[:, :, hand]),
    )
    for one, other in zip(level._summed(spread, 3), plain, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-12)


def test_a_cavity_is_the_mean_of_normal_densities() -> None:
    rng = np.random.default_rng(4)
    means, roots, x = (rng.standard_normal(s) for s in ((6, 3), (6, 3, 8), (20, 3)))
    covariances = roots @ roots.transpose(0, 2, 1)
    rest = Cavity(means, np.linalg.inv(np.linalg.cholesky(covariances)))
    off = x - means[:, None]
    square = np.einsum("kbi,kij,kbj->kb", off, np.linalg.inv(covariances), off)
    plain = np.exp(-0.5 * square) / np.sqrt(np.linalg.det(covariances))[:, None]
    np.testing.assert_allclose(rest(x), np.log(plain.mean(axis=0)), atol=1e-10)


def test_a_sampler_that_is_stopped_prints_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    calls = []

    def stopped(phi: Floats) -> Floats:
        calls.append(len(phi))
        if len(calls) > 3:
            raise KeyboardInterrupt
        return np.asarray(-0.5 * np.sum(phi**2, axis=1))

    rng = np.random.default_rng(1)
    walkers = Walkers(stopped, rng.standard_normal((16, 3)), np.random.RandomState(1).get_state())
    with pytest.raises(KeyboardInterrupt):
        walkers.advance(20)
    calls.clear()
    start, state = rng.standard_normal((256, 3)), np.random.RandomState(1).get_state()
    proposal = Proposal.first(student(np.zeros(3), np.eye(3), 8.0), rng)
    with pytest.raises(KeyboardInterrupt):
        Ensembles(stopped, proposal, 0.5, start, state).advance(20)
    assert not any(capsys.readouterr())


def test_recordings_that_went_astray_keep_their_own_descriptions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Seven people whose hands differ by 1.5 were said to differ by 30."""

    def description(mean: float) -> GaussianLikelihood:
        return GaussianLikelihood(np.array([mean]), np.eye(1), np.eye(1), 0.0)

    own = [description(mean) for mean in (0.0, 1.0, 2.0)]
    level = Hierarchy(
        tuple(description(mean) for mean in (-106.0, 1.1, 104.0)),
        *(np.arange(3), np.zeros(3, int), np.arange(1), np.arange(0), np.zeros(1), np.ones(1)),
    )
    # One that lay far away drew another one with it, and the third is alright once it is back.
    rounds = iter([[0], [0, 2], []])
    monkeypatch.setattr(settling, "settled", lambda level, *_: level)
    monkeypatch.setattr(settling, "astray", lambda *_: next(rounds))
    found = settling.settled_nearby(level, own, [], None, np.zeros(1))  # type: ignore[arg-type]
    assert [float(one.mean[0]) for one in found.likelihoods] == [0.0, 1.1, 2.0]


def test_tail_of_weights() -> None:
    rng = np.random.default_rng(9)
    assert pareto_k(np.zeros(1000)) == -np.inf
    for shape in (0.1, 0.3, 0.6, 0.9):
        found = [pareto_k(shape * rng.exponential(size=4000)) for _ in range(20)]
        # 189 weights in the tail: an error of (1 + k) / sqrt(189) of one, and drawn towards 0.5
        expected = (189 * shape + 5) / 199
        assert np.mean(found) == pytest.approx(expected, abs=3 * (1 + shape) / np.sqrt(189 * 20))


def test_priors_in_the_coordinates_of_a_study() -> None:
    model = bh.grasped(device="phantom", delay_sd_s=20e-6)
    here = study_coordinates(model)
    mean, sd = prior_moments(model, here)
    at = dict(zip(model.names, zip(mean, sd, here.scale, strict=True), strict=True))
    assert at["kh"][:2] == pytest.approx((np.log(model.reference["kh"]), 0.7), rel=0.01)
    assert at["b2"][0] == 0.0  # the wall: its half-normal is one half of a normal
    assert at["b2"][1] * at["b2"][2] == pytest.approx(2 * 0.057, rel=0.01)
    assert at["delay_s"][0] * at["delay_s"][2] == pytest.approx(150e-6)
    assert at["delay_s"][1] * at["delay_s"][2] == pytest.approx(20e-6, rel=0.01)


@pytest.mark.parametrize(("spread", "told"), [(0.03, True), (0.3, False)])
def test_people_as_alike_as_one_are_asked_about(spread: float, told: bool) -> None:
    sd = np.column_stack([np.full((9, 4), 0.01), np.full(9, spread)])
    texts = [one.text for one in _notices((), ("ana", "bo", "cy", "di"), sd)]
    assert len(texts) == told
    assert not told or "differ by 3 % at most" in texts[0] and "ana, bo, cy, di one" in texts[0]
