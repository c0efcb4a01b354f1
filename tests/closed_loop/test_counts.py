"""Counts of one mass that a white force disturbs: how likely they are, what is fitted to them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, norm, truncnorm

from bayeshaptic.inference.time_domain.counts import cut_normals
from bayeshaptic.inference.time_domain.counts.ascent import Likeliest
from bayeshaptic.inference.time_domain.counts.filter import Counts
from bayeshaptic.inference.time_domain.counts.fit import by_counts
from bayeshaptic.inference.time_domain.counts.likeliest import about, among, exactly
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.recordings import join_recordings, recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats
from benchmarks.bounds.one_mass_exact import likely
from benchmarks.recordings.one_mass import Case

PERIOD_S = 1e-3
TRUTH = np.array([1.5, 9.0, 0.5, 0.3, 1.4e-3])  # mass, damping, friction, constant force, delay
FORCE_SD, COUNT = 0.2, 2e-5


def moved(
    x: Floats, v: Floats, pull: Floats, values: Floats, span_s: float, steps: int = 10
) -> tuple[Floats, Floats]:
    """Masses some time later, in small steps: friction brings them to rest, and no further."""
    mass, damping, dry = values[:3]
    step_s = (span_s + 1e-12) / steps
    kept = np.exp(-damping / mass * step_s)
    for _ in range(steps):
        stops = pull + mass * v / step_s
        net = pull - np.sign(stops) * np.minimum(np.abs(stops), dry)
        ends = net / damping
        x = x + ends * step_s + (v - ends) * (1 - kept) * mass / damping
        v = ends + (v - ends) * kept
    return x, v


def looped(
    seconds: float, seed: int, values: Floats = TRUTH, count: float = COUNT, along: float = 0.0
) -> Recording:
    """A mass under steps of a controller that differentiates its counts.

    A white force is held from one change of the delayed command to the next.
    """
    rng = np.random.default_rng(seed)
    samples = round(seconds / PERIOD_S)
    wanted = np.repeat(rng.uniform(-0.03, 0.03, samples // 250 + 1), 250)[:samples]
    window = np.hanning(60)
    wanted = np.convolve(wanted, window / np.sum(window), "same")
    whole, late_s = divmod(values[4], PERIOD_S)
    x, v, white = np.zeros(1), np.zeros(1), 0.0
    last = 0.0
    force, position = np.zeros(samples + int(whole) + 1), np.zeros(samples)
    for k in range(samples):
        position[k] = seen = np.round(x[0] / count) * count
        force[k] = 900.0 * (wanted[k] - seen) - 45.0 * (seen - last) / PERIOD_S
        last = seen
        for ago, span_s in ((int(whole) + 1, late_s), (int(whole), PERIOD_S - late_s)):
            if ago == int(whole):
                white = FORCE_SD * rng.standard_normal()
            pull = (force[k - ago] if k >= ago else 0.0) - values[3] + white
            x, v = moved(x, v, pull + along * np.sin(200.0 * x), values, span_s)
    return recording_from_arrays(force[:samples], position, PERIOD_S)


def crawling(samples: int, seed: int, count: float) -> Recording:
    """A mass pushed about as hard as friction holds it: the white force moves it at times."""
    rng = np.random.default_rng(seed)
    force = TRUTH[3] + TRUTH[2] * (0.95 + 0.04 * np.sign(np.sin(np.arange(samples))))
    x, v = np.zeros(1), np.zeros(1)
    white, position = 0.0, np.zeros(samples)
    whole, late_s = divmod(TRUTH[4], PERIOD_S)
    for k in range(samples):
        position[k] = np.round(x[0] / count) * count
        for ago, span_s in ((int(whole) + 1, late_s), (int(whole), PERIOD_S - late_s)):
            if ago == int(whole):
                white = FORCE_SD * rng.standard_normal()
            pull = (force[k - ago] if k >= ago else 0.0) - TRUTH[3] + white
            x, v = moved(x, v, pull, TRUTH, span_s)
    return recording_from_arrays(force, position, PERIOD_S)


def counts_of(recording: Recording, unit: float = COUNT, cells: int = 16) -> Counts:
    signals = np.array(recording.force), np.array(recording.position)
    return Counts(*signals, PERIOD_S, unit, cells)


def test_moments_between_two_ends() -> None:
    for low, high in ((-0.3, 1.2), (2.0, 2.5), (-37.0, -6.0), (5.0, 37.0), (-1e-3, 1e-3)):
        found = cut_normals.between(low, high)
        known = truncnorm.stats(low, high, moments="mv")
        assert found[0] == pytest.approx(norm.cdf(-low) - norm.cdf(-high), rel=1e-6)
        assert found[1] == pytest.approx(float(known[0]), rel=1e-6, abs=1e-9)
        assert found[2] == pytest.approx(float(known[1]), rel=0.02)


def test_a_normal_that_is_cut_at_zero_is_found_by_its_moments() -> None:
    for mean in (-3.0, -0.5, 0.0, 1.0, 2.0):
        at, variance, skew = truncnorm.stats(-mean, np.inf, loc=mean, moments="mvs")
        sd = np.sqrt(variance)
        # Tables are straight between their rows.
        assert cut_normals.skewness(at / sd) == pytest.approx(float(skew), rel=0.02)
        end, before, wide, whole = cut_normals.cut_off(float(skew))
        assert end == pytest.approx(-at / sd, rel=0.01)
        assert before == pytest.approx((mean - at) / sd, rel=0.01, abs=0.01)
        assert wide == pytest.approx(1 / sd, rel=0.01)


def among_particles(counts: Counts, many: int, seed: int) -> tuple[Floats, float]:
    """Logarithms of the counts' probabilities, and the sd of their sum, by masses one by one."""
    rng = np.random.default_rng(seed)
    whole, late_s = divmod(TRUTH[4], PERIOD_S)
    x = counts.position[0] + counts.unit * rng.uniform(-0.5, 0.5, many)
    v, white = np.zeros(many), np.zeros(many)
    likely, left = [0.0], []
    for k in range(len(counts.position) - 1):
        for ago, span_s in ((int(whole) + 1, late_s), (int(whole), PERIOD_S - late_s)):
            if ago == int(whole):
                white = FORCE_SD * rng.standard_normal(many)
            pull = (counts.command[k - ago] if k >= ago else 0.0) - TRUTH[3] + white
            x, v = moved(x, v, pull, TRUTH, span_s)
        near = np.abs(x - counts.position[k + 1]) <= 0.5 * counts.unit
        likely.append(np.log(np.mean(near)))
        left.append((1 - np.mean(near)) / np.sum(near))
        drawn = rng.choice(np.flatnonzero(near), many)
        x, v, white = x[drawn], v[drawn], white[drawn]
    # What drawing so many adds to the sum, from sample to sample, with what they hand on.
    return np.array(likely), 2 * float(np.sqrt(np.sum(left)))


def test_probabilities_are_those_of_many_masses() -> None:
    """Beside particles, each a mass of its own; friction holds some of them for a while."""
    counts = counts_of(looped(0.3, seed=3))
    likely, by_chance = among_particles(counts, 40_000, seed=4)
    # The mass begins at rest here, and at any velocity there: that is soon forgotten.
    apart = (counts.after(TRUTH, FORCE_SD).likely - likely)[20:]
    assert abs(np.sum(apart)) < 4 * by_chance + 0.01 * len(apart)
    assert np.sqrt(np.mean(apart**2)) < 0.1


def test_probabilities_of_a_mass_that_crawls_are_those_of_many() -> None:
    """Held at every third sample or so, and a third of a count moves it within one."""
    counts = counts_of(crawling(400, seed=1, count=4e-7), unit=4e-7, cells=4)
    likely, by_chance = among_particles(counts, 20_000, seed=2)
    apart = (counts.after(TRUTH, FORCE_SD).likely - likely)[20:]
    # With one normal for all that move one way the sum is five lower, and this is 0.12.
    assert abs(np.sum(apart)) < 4 * by_chance + 0.005 * len(apart)
    assert np.sqrt(np.mean(apart**2)) < 0.08


def test_likelihoods_fall_as_on_a_grid() -> None:
    count = 2e-6
    recording = looped(1.0, seed=4, count=count)
    case = Case(recording, TRUTH, "", count, FORCE_SD)
    counts = counts_of(recording, unit=count)
    point = np.append(TRUTH, np.log(FORCE_SD))

    def both(at: Floats) -> Floats:
        mixed = counts.after(at[:5], float(np.exp(at[5]))).likely
        on_grid, lost = likely(case, at)
        assert lost < 1e-3
        return np.array([np.sum(one[60:]) for one in (mixed, on_grid)])  # begun otherwise

    middle = both(point)
    assert middle[0] == pytest.approx(middle[1], abs=1)
    for value, step in ((1, 0.1), (2, 0.015), (3, 0.015)):  # damping, friction, constant force
        off = np.zeros(len(point))
        off[value] = step
        low, high = both(point - off) - middle, both(point + off) - middle
        mixed, on_grid = low + high
        assert on_grid < -2
        assert mixed == pytest.approx(on_grid, rel=0.05)
        mixed, on_grid = high - low
        assert mixed == pytest.approx(on_grid, abs=0.2)


def test_it_does_not_matter_how_a_delay_is_split() -> None:
    """Next to a whole number of periods, from above and from below."""
    values = TRUTH.copy()
    values[4] = 2 * PERIOD_S
    counts = counts_of(looped(2.0, seed=5, values=values))
    found = []
    for off in (-1e-10, 0.0, 1e-10):
        near = np.append(values[:4], values[4] + off)
        found.append(float(np.sum(counts.after(near, FORCE_SD).likely)))
    assert np.ptp(found) < 0.5  # of a log likelihood, which says nothing of a delay


def test_innovations_of_the_truth_are_white() -> None:
    found = counts_of(looped(4.0, seed=2)).after(TRUTH, FORCE_SD)
    new, lags = found.innovations[10:], 20
    products = [new[k:] * new[:-k] for k in range(1, lags + 1)]
    assert sum(np.sum(one) ** 2 / (one @ one) for one in products) < chi2.isf(1e-4, lags)


def test_values_are_as_far_off_as_they_are_said_to_be() -> None:
    far = []
    for seed in range(40, 46):
        values = TRUTH * np.random.default_rng(seed).uniform(0.7, 1.4, 5)
        counts = counts_of(looped(1.5, seed, values), cells=4)
        found = exactly(about(counts, values), values[4], 1e-4)
        assert found is not None
        far.append((found.point[:5] - values) / np.sqrt(np.diag(found.covariance))[:5])
    square = np.sum(np.square(far))
    # Their covariance is known to a tenth or so, and the table of normals is none of the truth.
    assert chi2.ppf(1e-4, 30) < square < 1.3 * chi2.isf(1e-4, 30)


def test_a_delay_that_may_be_in_two_places_is_as_wide_as_both() -> None:
    """As many draws of two normals, each weighted by its likelihood and volume, about the first."""
    rng = np.random.default_rng(8)
    counts = counts_of(looped(0.1, seed=9))
    points = np.zeros((2, 6))
    points[1, 4] = 3.0
    likely = np.array([-10.0, -11.0])
    wide = np.array([1.0, 0.25])
    places = [
        Likeliest(counts, point, one, np.zeros((0, 6)), scale * np.eye(6), True)
        for point, one, scale in zip(points, likely, wide, strict=True)
    ]
    found = among(places[0], places).covariance
    mass = np.exp(likely) * wide**3  # the square root of the determinant
    at = rng.choice(2, 200_000, p=mass / mass.sum())
    drawn = points[at] + rng.standard_normal((len(at), 6))  # as wide as the first everywhere
    # A variance of n draws is known to sqrt(2/n); here with the tails of a mixture.
    np.testing.assert_allclose(found, drawn.T @ drawn / len(at), atol=0.05)
    assert among(places[0], places[:1]).covariance == pytest.approx(np.eye(6))


def test_what_a_controller_makes_of_counts_is_no_noise() -> None:
    recording = looped(4.0, seed=22)
    plain = fit_motion(recording)
    found = by_counts(plain, recording)
    assert found is not None
    assert found.disturbed is not None
    assert found.disturbed.force_sd == pytest.approx(FORCE_SD, rel=0.2)
    assert np.all(found.sd < plain.sd)
    far = (found.values - TRUTH) / found.sd
    assert np.sum(far**2) < 8 / 6 * chi2.isf(1e-4, 5)


def test_a_force_along_the_way_is_not_white() -> None:
    recording = looped(3.0, seed=20, along=0.3)
    assert by_counts(fit_motion(recording), recording) is None


def test_where_counts_are_nearly_certain_they_are_not_fitted() -> None:
    recording = looped(2.0, seed=23, count=3e-3)
    plain = fit_motion(looped(2.0, seed=23))
    assert by_counts(plain, recording) is None


def test_several_pieces_are_left_to_innovations() -> None:
    parts = [looped(1.5, seed) for seed in (24, 25)]
    joined = join_recordings(parts)
    assert by_counts(fit_motion(joined), joined) is None
