"""Crossings, critical stiffness and the rules, against the closed loop's own poles."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from bayeshaptic.errors import InputError
from bayeshaptic.models import Model, build_model, draw
from bayeshaptic.models.response.mechanism import Link, Mechanism
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.effective_draws import effective_draws
from bayeshaptic.rig import Bench, critical_limit
from bayeshaptic.stability import (
    confirms,
    critical_stiffness,
    find_crossings,
    ground_damping,
    passivity_limit,
    quantisation_limit,
    rigid_limit,
    spectral_radius,
)
from bayeshaptic.stability.binding import MODE, NEVER, RIGID, group_crossings
from bayeshaptic.stability.crossings import search
from bayeshaptic.stability.responses.evaluated import EvaluatedResponse
from bayeshaptic.stability.responses.response import PoleResponse, pole_response

T = 1e-3
CASES = [
    (device, name) for device in ("lhifam", "phantom") for name in ("rigid", "free", "grasped")
]


def one(*values):
    return tuple(np.array([float(value)]) for value in values)


def rigid_system(m, b, k=0.0, delay=0.0):
    (m, b, k, delay) = one(m, b, k, delay)
    return LinearSystem(Mechanism((m,), (Link(0, None, b, k),)), delay)


def random_systems(device, name, count, seed, delay=None):
    """Wide draws: factors of e on everything, dampers down to a thousandth, any delay up to 3 T."""
    rng = np.random.default_rng(seed)
    model = build_model(name, device)
    log_sd = rng.choice([0.3, 1.0, 2.0])
    theta = model.values * np.exp(log_sd * rng.normal(size=(count, model.size)))
    for damper in {"bc", "bs", "b2"} & set(model.names):
        theta[:, model.names.index(damper)] *= 10 ** rng.uniform(-3, 0, count)
    system = model.system(theta)
    late = rng.uniform(0, 3e-3, count) if delay is None else np.full(count, delay)
    return replace(system, delay_s=late)


# ---------------------------------------------------------------- against brute force


@pytest.mark.parametrize("delay", [0.0, 0.37e-3, T, 2.3 * T, None])
@pytest.mark.parametrize(("device", "name"), CASES)
def test_limit_against_a_scan_of_the_spectral_radius(device, name, delay):
    system = random_systems(device, name, 30, seed=11, delay=delay)
    critical = find_crossings(system, T).critical
    assert np.all(critical > 0)
    assert confirms(system, T, critical).all()
    # Stable all the way up: no crossing below was missed.
    steps = np.linspace(0, 1 - 1e-4, 122)[1:]
    assert np.all(spectral_radius(system, T, critical[:, None] * steps) < 1 + 1e-9)


@pytest.mark.parametrize(("device", "name"), CASES)
def test_every_crossing_against_a_dense_grid(device, name):
    system = random_systems(device, name, 20, seed=5)
    found = find_crossings(system, T)
    frequency = np.unique(
        np.concatenate([np.geomspace(1e-3, 500, 40_000), np.linspace(0.01, 500, 40_000)])
    )[:-1]
    response = system.sampled_response(frequency, T)
    for row in range(system.batch):
        g = response[row]
        change = np.signbit(g.imag[1:]) != np.signbit(g.imag[:-1])
        expected = frequency[1:][change & (g.real[1:] < 0) & (g.real[:-1] < 0)]
        mine = np.sort(found.frequency_hz[row])
        mine = mine[(mine > 1e-3) & (mine < 499.9)]
        assert len(mine) == len(expected)
        np.testing.assert_allclose(mine, expected, rtol=4e-4, atol=0.013)
        stiffness = np.sort(found.stiffness[row])
        assert np.array_equal(found.stiffness[row], stiffness, equal_nan=True)


@pytest.mark.parametrize("approximation", ["exact", "continuous"])
def test_crossings_to_twelve_digits(approximation):
    model = build_model("grasped", "lhifam")
    found = find_crossings(model.system(model.values), T, approximation)
    g = model.response(model.values, found.frequency_hz[0, :1], approximation)
    assert abs(g.imag[0] / g.real[0]) < 1e-10
    assert -1 / g.real[0] == pytest.approx(found.critical[0], rel=1e-10)


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(("device", "name"), CASES)
def test_a_system_without_poles_is_searched_by_its_response_alone(device, name, exact):
    model = build_model(name, device)
    rng = np.random.default_rng(3)
    theta = np.column_stack([draw(model.prior(key), rng, 6) for key in model.names])
    system = model.system(theta)
    with_poles = search(pole_response(system, T, exact), T)
    without = search(EvaluatedResponse(system, T, exact), T)
    np.testing.assert_allclose(without.frequency_hz, with_poles.frequency_hz, rtol=1e-9)
    np.testing.assert_allclose(without.stiffness, with_poles.stiffness, rtol=1e-9)
    assert without.stable_at_rest.all()


def test_system_that_says_it_is_not_rational_takes_the_fine_grid():
    @dataclass(frozen=True)
    class Unrational(LinearSystem):
        rational = False

        def poles(self):
            raise AssertionError("has no poles")

    model = build_model("free", "lhifam")
    system = model.system(model.values)
    other = Unrational(system.mechanism, system.delay_s)
    assert find_crossings(other, T).critical == pytest.approx(
        find_crossings(system, T).critical, rel=1e-9
    )


@pytest.mark.parametrize("delay", [0.0, 2e-4, 1.7e-3])
@pytest.mark.parametrize(("device", "name"), CASES)
def test_limit_of_the_virtual_bench(device, name, delay):
    """The bench closes its own loop, and shares no code with the models."""
    model = build_model(name, device, delay_s=delay)
    limit = critical_stiffness(model)
    truth = critical_limit(Bench.from_device(device, mechanism=name, delay_s=delay))
    assert limit.value == pytest.approx(truth.stiffness, rel=1e-6)
    assert limit.frequency_hz[0] == pytest.approx(truth.frequency_hz, rel=1e-4)


# ---------------------------------------------------------------- corners


@pytest.mark.parametrize("frequency_hz", [845.0, 1155.0, 2000.0 + 155.0])
def test_lightly_damped_mode_beyond_the_nyquist_frequency_binds_at_its_alias(frequency_hz):
    rate = 2 * np.pi * frequency_hz
    mechanism = Mechanism(
        one(5.0, 0.2), (Link(0, None, *one(5, 0)), Link(0, 1, *one(5e-5, rate**2 * 1 / 5.2)))
    )
    system = LinearSystem(mechanism, *one(2e-4))
    critical = find_crossings(system, T).critical
    assert confirms(system, T, critical).all()
    steps = np.linspace(0, 1 - 1e-4, 1001)[1:]
    assert np.all(spectral_radius(system, T, critical[:, None] * steps) < 1 + 1e-9)


def test_limit_far_below_any_measured_band():
    model = build_model("free", "lhifam")
    values = model.values.copy()
    values[[model.names.index("b1"), model.names.index("b2")]] = 0.01, 0.0
    limit = critical_stiffness(model, values)
    # Rule (19) holds ever better as the crossing goes to zero: 0.01 / 0.7 ms.
    assert limit.value == pytest.approx(0.01 / 0.7e-3, rel=2e-4)
    assert limit.frequency_hz[0] < 0.3
    assert limit.confirmed == 1
    found = find_crossings(model.system(values), T)
    assert found.stiffness[0, 1] == pytest.approx(23.7e3, rel=0.01)


@pytest.mark.parametrize("damping", [1e-3, 1e-6, 1e-9])
def test_damping_towards_zero(damping):
    system = rigid_system(5.39, damping, delay=2e-4)
    critical = find_crossings(system, T).critical
    assert critical == pytest.approx(damping / 0.7e-3, rel=1e-3)


def test_without_any_damping_nothing_is_stable():
    assert find_crossings(rigid_system(1.0, 0.0, delay=1e-4), T).critical == 0
    free = build_model("free", "lhifam")
    values = free.values * np.array([1, 0, 1, 1, 1, 0])
    limit = critical_stiffness(free, values)
    assert limit.value == 0
    assert limit.crossings[0].label == "unstable at any stiffness"
    assert limit.crossings[0].frequency_hz is None
    assert limit.confirmed == 1


def test_unstable_by_itself():
    assert find_crossings(rigid_system(1.0, 2.0, k=-50.0), T).critical == 0
    assert find_crossings(rigid_system(1.0, -2.0, k=50.0), T).critical == 0
    # A second mode with negative damping behind a well damped device.
    mechanism = Mechanism(one(1, 0.1), (Link(0, None, *one(5, 1e4)), Link(0, 1, *one(-1, 1e3))))
    system = LinearSystem(mechanism, *one(1e-4))
    assert find_crossings(system, T).critical == 0
    assert spectral_radius(system, T, np.array([1e-3])) > 1


def test_a_delay_that_rounding_took_below_zero_is_none():
    walls = np.array([10.0, 100.0])
    none, below = (spectral_radius(rigid_system(0.5, 2.0, delay=d), T, walls) for d in (0, -1e-19))
    np.testing.assert_allclose(below, none, rtol=1e-12)


def test_undamped_mode_is_unstable_with_delay():
    assert find_crossings(rigid_system(1.0, 0.0, k=1e4, delay=1e-4), T).critical == 0


def test_well_damped_device_binds_at_the_nyquist_frequency():
    m, b = 0.01, 40.0
    system = rigid_system(m, b)
    found = find_crossings(system, T)
    assert found.binding_hz == pytest.approx(500.0)
    # Textbook hold equivalent of 1 / (s (m s + b)) at z = -1.
    a = np.exp(-b * T / m)
    first = T / b - m / b**2 * (1 - a)
    second = m / b**2 * (1 - a) - T / b * a
    nyquist = (-first + second) / (2 * (1 + a))
    assert found.critical == pytest.approx(-1 / nyquist, rel=1e-9)
    assert confirms(system, T, found.critical).all()


def test_nyquist_crossing_counts_its_sign_with_whole_periods_of_delay():
    for delay in (T, 2 * T):
        system = rigid_system(0.01, 40.0, delay=delay)
        assert confirms(system, T, find_crossings(system, T).critical).all()


@pytest.mark.parametrize("spread", [0.0, 1e-9, 1e-6, 1e-3])
def test_double_and_nearly_double_poles(spread):
    rate = 200.0
    system = rigid_system(1.0, rate * (2 + spread), k=rate**2 * (1 + spread), delay=3e-4)
    critical = find_crossings(system, T).critical
    assert confirms(system, T, critical, step=1e-6).all()


def test_filters_in_the_loop():
    model = build_model("free", "phantom")
    plain = model.system(model.values)
    lag = plain.with_filter(np.array([[1.0]]), np.array([[1.0], [5e-4]]))
    lead = lag.with_filter(np.array([[1.0], [2e-4]]), np.array([[1.0], [1e-4], [1e-8]]))
    for system in (lag, lead):
        critical = find_crossings(system, T).critical
        assert confirms(system, T, critical).all()
        assert critical < find_crossings(plain, T).critical


def test_two_crossings_that_are_about_to_merge_are_both_found():
    model = build_model("free", "lhifam")

    def rigid_pair(b2):
        values = model.values.copy()
        values[model.names.index("b2")] = b2
        frequency = np.sort(find_crossings(model.system(values), T).frequency_hz[0])
        return frequency[frequency < 50]

    low, high = 6.8, 9.0  # two crossings near 9 Hz, and none
    assert (len(rigid_pair(low)), len(rigid_pair(high))) == (2, 0)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if len(rigid_pair(middle)) == 2 else (low, middle)
    pair = rigid_pair(low)
    assert pair[1] / pair[0] - 1 < 1e-4


# ---------------------------------------------------------------- pieces


def test_effective_draws():
    rng = np.random.default_rng(8)
    noise = rng.normal(size=(64, 1000))
    assert effective_draws(noise) == pytest.approx(noise.size, rel=0.05)
    rho = 0.8
    chains = noise.copy()
    for step in range(1, 1000):
        chains[:, step] = rho * chains[:, step - 1] + np.sqrt(1 - rho**2) * noise[:, step]
    assert effective_draws(chains) == pytest.approx(noise.size * (1 - rho) / (1 + rho), rel=0.15)
    # Chains that do not agree are worth little more than their number.
    assert effective_draws(noise + 10 * np.arange(64)[:, None]) < 200


def test_rules():
    assert rigid_limit(6.9, 2e-4, T) == pytest.approx(6.9 / 7e-4)
    assert passivity_limit(6.9, T) == pytest.approx(13800)
    assert passivity_limit(6.9, T, -1.9) == pytest.approx(10000)
    assert passivity_limit(1.0, T, 3.0) == 0
    assert quantisation_limit(6.9, 1.0, 1e-6, T) == pytest.approx(13800)
    assert quantisation_limit(6.9, 1e-3, 1e-6, T) == pytest.approx(2000)
    model = build_model("grasped", "lhifam")
    assert ground_damping(model.system(model.values)) == pytest.approx(0.1 + 4.0 + 18.34)


def test_passivity_is_the_more_careful_rule():
    system = rigid_system(5.39, 6.9)
    assert passivity_limit(6.9, T) <= find_crossings(system, T).critical[0] * (1 + 1e-3)


# ---------------------------------------------------------------- distributions


@dataclass(frozen=True)
class Chains:
    """As much of a posterior as the critical stiffness needs."""

    model: Model
    chains: np.ndarray


def spread_posterior(name="free", device="lhifam", steps=60, log_sd=0.02):
    model = build_model(name, device)
    rng = np.random.default_rng(4)
    noise = rng.normal(size=(2, steps, 32, model.size))
    return Chains(model, model.values * np.exp(log_sd * noise))


def test_distribution_names_both_crossings():
    limit = critical_stiffness(spread_posterior())
    assert [crossing.label.rsplit(" at ", 1)[0] for crossing in limit.crossings] == [
        "rigid body", "vibration mode",
    ]  # fmt: skip
    assert sum(crossing.probability for crossing in limit.crossings) == pytest.approx(1)
    for number, crossing in enumerate(limit.crossings):
        mine = limit.group == number
        assert mine.mean() == pytest.approx(crossing.probability)
        assert np.median(limit.frequency_hz[mine]) == pytest.approx(crossing.frequency_hz)
    assert limit.confirmed == limit.checked == 64
    assert limit.unit == "N/m"


def test_quantiles_and_risk():
    posterior = spread_posterior()
    limit = critical_stiffness(posterior)
    assert limit.samples.shape == (2 * 60 * 32,)
    assert limit.chains == 64
    assert limit.value == limit.quantile(0.5) == pytest.approx(np.median(limit.samples))
    assert limit.db(0.5) == pytest.approx(20 * np.log10(limit.value))
    assert limit.quantile([0.05, 0.95]).shape == (2,)
    assert limit.effective == pytest.approx(3840, rel=0.1)
    assert limit.safe(0.05) == pytest.approx(limit.quantile(0.05))
    assert limit.probability_unstable(limit.quantile(0.3)) == pytest.approx(0.3, abs=1e-3)
    assert limit.safe(0.01) is not None  # 38 below
    tail = limit.low_quantile(0.001)  # 4 below: a fitted tail
    assert tail.fitted and tail.value == limit.safe(0.001) < limit.safe(0.01)
    # The first vector of the first walker is the first sample, the last of the last the last.
    chains = posterior.chains
    ends = critical_stiffness(posterior.model, np.stack([chains[0, 0, 0], chains[-1, -1, -1]]))
    np.testing.assert_allclose(ends.samples, limit.samples[[0, -1]])


def test_correlated_draws_are_not_counted_as_independent():
    posterior = spread_posterior(steps=50)
    sticky = Chains(posterior.model, np.repeat(posterior.chains, 10, axis=1))
    limit = critical_stiffness(sticky)
    assert len(limit.samples) == 32_000
    assert limit.effective < 4500
    # 160 draws below, and 16 effective ones
    assert limit.low_quantile(0.005).fitted and not limit.low_quantile(0.01).fitted


def test_long_posteriors_are_thinned_along_the_chains():
    posterior = spread_posterior(steps=60)
    limit = critical_stiffness(posterior, max_draws=1000)
    assert limit.samples.shape == (2 * 15 * 32,)
    assert limit.chains == 64
    # However few are asked for, each chain keeps one.
    assert critical_stiffness(posterior, max_draws=3).samples.shape == (64,)
    whole = critical_stiffness(posterior)
    np.testing.assert_allclose(limit.samples, whole.samples.reshape(64, 60)[:, 3::4].ravel())


def test_a_delay_that_is_a_parameter():
    model = build_model("free", "lhifam", delay_s=2e-4, delay_sd_s=5e-5)
    theta = np.tile(model.values, (3, 1))
    theta[:, -1] = [1e-4, 2e-4, 3e-4]
    limit = critical_stiffness(model, theta)
    assert np.all(np.diff(limit.samples) < 0)
    known = critical_stiffness(build_model("free", "lhifam"))
    assert limit.samples[1] == pytest.approx(known.value)


def test_tip():
    limit = critical_stiffness(build_model("free", "phantom"))
    tip = limit.tip(0.12)
    assert (limit.unit, tip.unit) == ("N m/rad", "N/m")
    assert tip.value == pytest.approx(limit.value / 0.0144)
    with pytest.raises(InputError, match="N m/rad"):
        critical_stiffness(build_model("free", "lhifam")).tip(0.12)
    with pytest.raises(InputError, match="lever_m is 0"):
        limit.tip(0.0)


def test_infinite_and_zero_limits_keep_their_place():
    limit = critical_stiffness(spread_posterior(steps=10))
    mixed = replace(limit, samples=np.where(np.arange(640) % 4 == 0, np.inf, 100.0))
    assert mixed.quantile(0.5) == 100.0
    assert mixed.quantile(0.9) == np.inf
    assert mixed.effective > 0
    never = replace(limit, samples=np.zeros(640))
    assert never.db(0.5) == -np.inf


def test_refusals():
    model = build_model("free", "lhifam")
    with pytest.raises(InputError, match="exact"):
        critical_stiffness(model, approximation="pade")
    with pytest.raises(InputError, match="no values"):
        critical_stiffness(build_model("free", period_s=T))
    with pytest.raises(InputError, match="sampling period"):
        critical_stiffness(build_model("free"), np.ones((1, 7)))


def test_groups_part_at_wide_gaps_only():
    rng = np.random.default_rng(2)
    frequency = np.concatenate(
        [rng.normal(52, 0.5, 400), rng.normal(63, 0.5, 590), np.array([120.0]), np.zeros(9)]
    )
    kinds = np.where(frequency == 0, NEVER, np.where(frequency < 55, RIGID, MODE))
    crossings, group = group_crossings(kinds, frequency)
    assert [c.label for c in crossings] == [
        "vibration mode at 63 Hz", "rigid body at 52 Hz", "unstable at any stiffness",
    ]  # fmt: skip
    assert np.bincount(group).tolist() == [591, 400, 9]
    one_kind, _ = group_crossings(np.full(990, MODE), frequency[:990])
    assert [round(c.probability, 3) for c in one_kind] == [0.596, 0.404]


def test_a_pole_that_runs_away_beside_a_far_one_is_no_marginal_one() -> None:
    """Of draws of a person who has not been seen: with a warning of NumPy on the terminal."""
    poles = np.array([[-1e13 + 0j, -700.0 + 2j], [-1e13 + 0j, 700.0 + 2j], [-1.0 + 0j, 1j]])
    ones = np.ones_like(poles)
    nothing = np.zeros(3), np.zeros(3, int)
    found = PoleResponse(poles, ones, ones, 0 * ones, poles, *nothing, exact=True)
    assert found.stable_at_rest().tolist() == [True, False, True]


def test_a_filter_of_a_microsecond_makes_no_slow_pole_marginal() -> None:
    """A load of a ton stood for a hand's ground: with any filter one in eight limits was 0."""
    rates = np.array([5e-5, 1e-5])  # at which the load comes to rest, 1/s
    mass, load, none = (np.full(2, value) for value in (2.3, 1e3, 0.0))
    links = (Link(0, 1, np.full(2, 6.0), np.full(2, 360.0)), Link(1, None, load * rates, none))
    plain = LinearSystem(Mechanism((mass, load), links), np.full(2, 2e-6))
    filtered = plain.with_filter(np.ones((1, 2)), np.stack([np.ones(2), np.full(2, 1e-6)]))
    limits = [find_crossings(system, T).critical for system in (plain, filtered)]
    assert (limits[0] > 1e4).all()
    assert limits[1] == pytest.approx(limits[0], rel=1e-2)
