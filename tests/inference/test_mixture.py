"""Student mixtures, their fit, and the straightening of curved densities."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest, multivariate_t, t as student_t

from bayeshaptic.inference.sampling.ensembles import warmed_up
from bayeshaptic.inference.sampling.proposal import fitted as fitted_proposal
from bayeshaptic.numerics.mixture import StudentMixture, student
from bayeshaptic.numerics.mixture_fit import fit_student_mixture
from bayeshaptic.numerics.straightening import nothing_to_straighten, straighten
from bayeshaptic.numerics.weights import effective, normalised, tempered


def two_humps(size: int = 2, freedom: float = 8.0) -> StudentMixture:
    rng = np.random.default_rng(1)
    spread = rng.standard_normal((size, size))
    first = student(np.zeros(size), spread @ spread.T + np.eye(size), freedom)
    second = student(np.full(size, 6.0), 0.3 * np.eye(size), freedom)
    return first.with_component(second, 0.3)


@pytest.mark.parametrize("freedom", [3.0, 8.0, 50.0])
def test_density_of_one_component_is_the_textbooks(freedom):
    rng = np.random.default_rng(0)
    spread = rng.standard_normal((3, 3))
    scale, mean = spread @ spread.T + 0.1 * np.eye(3), rng.standard_normal(3)
    x = mean + 3 * rng.standard_normal((40, 3))
    truth = multivariate_t(mean, scale, df=freedom).logpdf(x)
    assert student(mean, scale, freedom).log_density(x) == pytest.approx(truth, abs=1e-9)


def test_components_have_degrees_of_freedom_of_their_own():
    """What covers the tails leaves the rest as it is."""
    normal = student(np.zeros(1), np.eye(1), 200.0)
    both = normal.with_component(student(np.array([9.0]), np.eye(1), 3.0), 0.25)
    x = both.sample(np.random.default_rng(21), 20_000)[:, 0]

    def below(value):
        return 0.75 * student_t(200.0).cdf(value) + 0.25 * student_t(3.0).cdf(value - 9.0)

    assert kstest(below(x), "uniform").pvalue > 1e-3
    at = np.linspace(-5, 20, 11)
    truth = 0.75 * student_t(200.0).pdf(at) + 0.25 * student_t(3.0).pdf(at - 9.0)
    assert np.exp(both.log_density(at[:, None])) == pytest.approx(truth, rel=1e-9)


def test_density_integrates_to_one():
    line = student(np.array([1.0]), np.array([[4.0]]), 5.0).with_component(
        student(np.array([-3.0]), np.array([[0.1]]), 5.0), 0.25
    )
    area, _ = quad(lambda x: np.exp(line.log_density(np.array([[x]]))[0]), -np.inf, np.inf)
    assert area == pytest.approx(1.0, abs=1e-6)
    plane = two_humps()
    grid = np.linspace(-40, 46, 801)
    points = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
    total = np.exp(plane.log_density(points)).sum() * (grid[1] - grid[0]) ** 2
    assert total == pytest.approx(1.0, abs=2e-3)


def test_draws_follow_the_density():
    mixture = two_humps()
    x = mixture.sample(np.random.default_rng(3), 20_000)
    mean = 0.3 * 6.0
    assert x.mean(axis=0) == pytest.approx([mean, mean], abs=5 * x.std() / np.sqrt(len(x)))
    scales = [root @ root.T * 8 / 6 for root in mixture.roots]  # a t's covariance
    covariance = 0.7 * scales[0] + 0.3 * scales[1] + 0.21 * 36 * np.ones((2, 2))
    assert np.cov(x.T) == pytest.approx(covariance, rel=0.05)
    direction = np.array([0.6, -0.8])
    centres = mixture.means @ direction
    widths = np.sqrt([direction @ root @ root.T @ direction for root in mixture.roots])

    def below(value):
        return sum(
            w * student_t(8.0).cdf((value - c) / s)
            for w, c, s in zip(mixture.weights, centres, widths, strict=True)
        )

    assert kstest(below(x @ direction), "uniform").pvalue > 1e-3


def test_a_fit_finds_the_components():
    rng = np.random.default_rng(4)
    truth = two_humps(3)
    x = truth.sample(rng, 20_000)
    fitted = fit_student_mixture(x, np.ones(len(x)), 2, 8.0, rng)
    order = np.argsort(-fitted.weights)
    assert fitted.weights[order] == pytest.approx([0.7, 0.3], abs=0.02)
    assert fitted.means[order] == pytest.approx(truth.means, abs=0.1)
    # Kullback and Leibler's distance between truth and fit, by the draws.
    loss = np.mean(truth.log_density(x) - fitted.log_density(x))
    assert -0.01 < loss < 0.01


def test_a_fit_to_weighted_points():
    rng = np.random.default_rng(5)
    wide = student(np.array([1.0, 0.0]), 9 * np.eye(2), 8.0)
    truth = student(np.array([0.0, 1.0]), np.array([[1.0, 0.8], [0.8, 1.0]]), 8.0)
    x = wide.sample(rng, 20_000)
    weights = np.exp(truth.log_density(x) - wide.log_density(x))
    fitted = fit_student_mixture(x, weights, 2, 8.0, rng)
    drawn = truth.sample(rng, 5000)
    assert abs(np.mean(truth.log_density(drawn) - fitted.log_density(drawn))) < 0.02


def test_points_on_a_line_do_not_break_a_fit():
    rng = np.random.default_rng(6)
    x = np.outer(rng.standard_normal(500), [1.0, 2.0, -1.0])
    fitted = fit_student_mixture(x, np.ones(500), 3, 8.0, rng)
    assert np.isfinite(fitted.log_density(x)).all()
    assert np.isfinite(fitted.sample(rng, 10)).all()


def test_weights_are_tempered_until_enough_points_count():
    """One may be heavier than the others by more than a number can hold."""
    log_weights = np.concatenate([[0.0], -1e6 - np.arange(499.0)])
    weights = tempered(log_weights, 100.0)
    assert weights.sum() == pytest.approx(1.0)
    assert effective(weights) >= 100.0
    even = tempered(np.zeros(500), 100.0)
    assert effective(even) == pytest.approx(500.0)
    assert np.isfinite(normalised(np.full(5, -np.inf))).all()


def test_warming_up_finds_a_density_that_the_first_guess_hardly_knows():
    target = two_humps(4)
    first = student(np.full(4, 3.0), 16 * np.eye(4))
    seed = np.random.SeedSequence(7)
    ensembles = warmed_up(target.log_density, first, seed, np.full(4, 3.0))
    chains, _ = ensembles.advance(400)
    assert chains.mean(axis=(0, 1, 2)) == pytest.approx(np.full(4, 1.8), abs=0.2)


def test_no_round_of_a_warm_up_begins_after_the_steps_it_may_take():
    """Or a hard density has spent what there is before a draw is kept."""
    first, target = student(np.zeros(6), np.eye(6)), student(np.zeros(6), 1e-4 * np.eye(6))
    taken = []

    def counted(x):
        taken[-1] += len(x)
        return target.log_density(x)

    for most in (1, np.inf):
        taken.append(0)
        warmed_up(counted, first, np.random.SeedSequence(8), np.zeros(6), None, most)
    one_round = 256 * (16 + 1 + 8 + 1)  # steps, and where each advance begins
    others = 4 * 4 * 64 + 1000  # starts, of which all are possible, and tries of the proposal
    assert taken[0] <= one_round + others < taken[1]


def test_warming_up_survives_a_guess_outside_the_support():
    def target(x):
        return np.where(np.all(x > 5, axis=1), -0.5 * np.sum(x**2, axis=1), -np.inf)

    guess = student(np.zeros(2), np.eye(2))
    ensembles = warmed_up(target, guess, np.random.SeedSequence(9), np.full(2, 6.0))
    chains, _ = ensembles.advance(50)
    assert (chains > 5).all()


def test_a_fit_to_one_point_is_that_point():
    x = np.random.default_rng(17).standard_normal((500, 3))
    weights = np.zeros(500)
    weights[7] = 1.0
    fitted = fit_student_mixture(x, weights, 1, 8.0, np.random.default_rng(18))
    drawn = fitted.sample(np.random.default_rng(19), 100)
    assert drawn == pytest.approx(np.tile(x[7], (100, 1)), abs=1e-6)
    assert np.isfinite(fitted.log_density(x)).all()


def banana(rng: np.random.Generator, count: int) -> np.ndarray:
    """A ridge bent twice in five dimensions, a hundred times longer than it is thick."""
    z = rng.standard_normal((count, 5)) * [3.0, 1.0, 0.03, 0.05, 0.5]
    z[:, 2] += 0.02 * z[:, 0] ** 2 + 0.5 * z[:, 0]
    z[:, 3] += 0.1 * z[:, 4] ** 2 - z[:, 1]
    return z + 7.0


def test_straightening_goes_there_and_back_and_keeps_volumes():
    x = banana(np.random.default_rng(10), 3000)
    straightening = straighten(x)
    y = straightening.straight(x)
    assert straightening.bent(y) == pytest.approx(x, rel=1e-9)
    determinants = []
    for point in x[:5]:
        corners = np.vstack([point, point + 1e-5 * np.eye(5)])
        image = straightening.straight(corners)
        determinants.append(np.linalg.det((image[1:] - image[0]) / 1e-5))
    assert determinants == pytest.approx([determinants[0]] * 5, rel=1e-3)


def test_straightening_makes_a_bent_ridge_normal():
    rng = np.random.default_rng(11)
    straightening = straighten(banana(rng, 3000))
    fresh = banana(rng, 5000)

    def entropy(points):  # of the normal distribution with their covariance
        return 0.5 * np.linalg.slogdet(np.cov(points.T))[1]

    # Volume, in logarithms, that one normal distribution needs for it: 2.3 too much at first.
    exact = np.log([3.0, 1.0, 0.03, 0.05, 0.5]).sum()
    change = np.linalg.slogdet(straightening.whiten)[1]
    assert entropy(fresh) > exact + 2.2
    assert entropy(straightening.straight(fresh)) - change < exact + 0.8


def test_far_points_do_not_warn():
    straightening = straighten(banana(np.random.default_rng(14), 3000))
    far = straightening.bent(np.full((1, 5), 1e200))
    assert not np.isfinite(far).all()


def test_accidents_of_few_draws_bend_nothing():
    straightening = straighten(np.random.default_rng(22).standard_normal((1000, 11)))
    assert not straightening.quadratic.any()


def test_nothing_to_straighten():
    x = np.random.default_rng(12).standard_normal((20, 3))
    same = nothing_to_straighten(3)
    assert np.array_equal(same.straight(x), x) and np.array_equal(same.bent(x), x)


def test_few_points_decide_few_terms():
    x = np.random.default_rng(13).standard_normal((100, 12))
    straightening = straighten(x)
    assert np.count_nonzero(straightening.quadratic[-1]) <= 100 / 30
    assert straightening.bent(straightening.straight(x)) == pytest.approx(x, abs=1e-9)


def test_a_skewed_component_is_freed_from_its_square():
    """Of v and v^2, correlated where v is skewed, the second follows the first exactly."""
    rng = np.random.default_rng(15)
    v = rng.gamma(3.0, size=4000)
    x = np.column_stack([v, v**2 + 0.01 * rng.standard_normal(4000)])
    y = straighten(x).straight(x)
    second = np.column_stack([np.ones(4000), y[:, 0], y[:, 0] ** 2])
    left = y[:, 1] - second @ np.linalg.lstsq(second, y[:, 1], rcond=None)[0]
    # Nothing that a parabola in the first could still take away, but for the ridge of the fit.
    assert np.std(left) > 0.9 * np.std(y[:, 1])


@pytest.mark.parametrize("size", [6, 11])
def test_draws_that_are_all_one_in_most_parameters_are_straight(size):
    # Walkers that were drawn again from one far better than all others.
    rng = np.random.default_rng(7)
    x = np.tile(rng.normal(size=size), (4000, 1))
    x[:, 2] += rng.normal(size=4000)
    straightening = straighten(x)
    assert straightening.bent(straightening.straight(x)) == pytest.approx(x, rel=1e-9)


def test_walkers_that_stay_bend_no_ridge():
    """Sixty draws of one place far out look like a clear bend, but are one."""
    rng = np.random.default_rng(20)
    walkers = rng.standard_normal((100, 60, 3)) * [3.0, 2.0, 1.0]
    bent = walkers.copy()
    bent[..., 2] += 0.3 * walkers[..., 0] ** 2  # as all of them see
    walkers[0], walkers[1] = [15.0, 0.0, 5.0], [-15.0, 0.0, 5.0]
    x = walkers.reshape(-1, 3)
    assert straighten(x).quadratic.any()
    assert not straighten(x, together=60).quadratic.any()
    assert straighten(bent.reshape(-1, 3), together=60).quadratic.any()


def test_a_proposal_reaches_a_tail_that_a_redraw_shows_and_no_walker_has_seen():
    """A hundredth of the draws lies far out: a walker that came there would stay."""
    rng = np.random.default_rng(19)
    bulk, tail = rng.standard_normal((2000, 3)), rng.standard_normal((200, 3))
    tail[:, 2] = rng.uniform(-12, -5, len(tail))

    def density(x):
        across = -0.5 * np.sum(x[:, :2] ** 2, axis=1)
        with np.errstate(divide="ignore"):
            far = np.log(0.01 / 7 * ((x[:, 2] > -12) & (x[:, 2] < -5)))
        near = np.log(0.99 / np.sqrt(2 * np.pi)) - 0.5 * x[:, 2] ** 2
        return across + np.logaddexp(near, far)

    def redraw(x, rng):
        drawn = x.copy()
        drawn[:, 2] = rng.uniform(-12, 4, len(x))
        return drawn, np.zeros(len(x))

    def missed(shown):
        chains = bulk.reshape(4, 10, 50, 3)
        made = fitted_proposal(chains, density(bulk).reshape(4, 10, 50), density, shown, rng)
        excess = [
            density(x) - made.mixture.log_density(made.straightening.straight(x))
            for x in (tail, bulk)
        ]
        return np.median(excess[0]) - np.median(excess[1])

    assert missed(None) > 3.0  # twenty steps for one in the bulk, and more
    assert missed(redraw) < 1.0
