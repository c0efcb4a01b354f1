"""The sampled response against matrix exponentials and against a simulation in the time domain."""

from __future__ import annotations

import numpy as np
import pytest
from plain_alias_series import from_polynomials
from plain_response import from_poles
from scipy.linalg import expm
from scipy.signal import tf2ss

from bayeshaptic.devices import load_device
from bayeshaptic.models import build_model, draw
from bayeshaptic.models.response.mechanism import Link, Mechanism
from bayeshaptic.models.response.system import LinearSystem

T = 1e-3
FREQUENCY = np.geomspace(0.3, 499.9, 60)
DELAYS = np.array([0.0, 0.2, 0.999, 1.0, 2.3]) * T
CASES = [(d, s) for d in ("lhifam", "phantom") for s in ("rigid", "free", "grasped")]


def chain_matrices(structure: str, v: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """A and B of the chain of masses, force on the first; written out by hand."""
    if structure == "rigid":
        return np.array([[0, 1], [0, -v["b"] / v["m"]]]), np.array([0, 1 / v["m"]])
    m = np.array([v["m1"], v["m2"]])
    k = np.array([[v["kc"], -v["kc"]], [-v["kc"], v["kc"]]])
    b = np.array([[v["b1"] + v["bc"], -v["bc"]], [-v["bc"], v["b2"] + v["bc"]]])
    if structure == "grasped":
        m = np.append(m, v["mh"])
        k, b = np.pad(k, (0, 1)), np.pad(b, (0, 1))
        grip = np.array([[0, 0, 0], [0, 1, -1], [0, -1, 1]])
        k, b = k + v["ks"] * grip, b + v["bs"] * grip
        k[2, 2] += v["kh"]
        b[2, 2] += v["bh"]
    n = len(m)
    a = np.block([[np.zeros((n, n)), np.eye(n)], [-k / m[:, None], -b / m[:, None]]])
    force = np.zeros(2 * n)
    force[n] = 1 / m[0]
    return a, force


def by_matrix_exponential(a, b, c, delay_s, frequency_hz=FREQUENCY, period_s=T):
    """c (z - Ad)^-1 (late + early / z) z^-d of x' = A x + B u(t - delay), u held."""
    whole = int(np.floor(delay_s / period_s + 1e-12))
    late = delay_s - whole * period_s
    n = len(a)

    def hold(seconds):
        both = expm(np.block([[a, b[:, None]], [np.zeros((1, n + 1))]]) * seconds)
        return both[:n, n]

    new = hold(period_s - late)
    old = hold(period_s) - new
    z = np.exp(2j * np.pi * frequency_hz * period_s)
    resolvent = z[:, None, None] * np.eye(n) - expm(a * period_s)
    right = new[:, None] + old[:, None] / z[:, None, None]
    return np.linalg.solve(resolvent, right)[:, :, 0] @ c * z**-whole


def reference(structure, values, delay_s, frequency_hz=FREQUENCY, period_s=T):
    a, b = chain_matrices(structure, values)
    c = np.zeros(len(a))
    c[0] = 1
    return by_matrix_exponential(a, b, c, delay_s, frequency_hz, period_s)


def relative(value: np.ndarray, truth: np.ndarray) -> float:
    return float(np.max(np.abs(value / truth - 1)))


def both_routes(system: LinearSystem, frequency_hz=FREQUENCY, period_s=T):
    fast, good = from_polynomials(*system.transfer(), system.delay_s, frequency_hz, period_s)
    return fast, good, from_poles(*system.poles(), system.delay_s, frequency_hz, period_s)


@pytest.mark.parametrize(("device", "structure"), CASES)
def test_published_devices_against_matrix_exponentials(device, structure):
    values = load_device(device).parameters[structure]
    model = build_model(structure, device, delay_sd_s=1e-5)  # the delay as a parameter
    for delay in DELAYS:
        truth = reference(structure, values, delay)
        vector = np.array([*(values[name] for name in model.names[:-1]), delay])
        assert relative(model.response(vector, FREQUENCY), truth) < 1e-9


@pytest.mark.parametrize(("device", "structure"), CASES)
def test_batches_drawn_from_priors_by_both_routes(device, structure):
    model = build_model(structure, device, delay_sd_s=3e-4)
    rng = np.random.default_rng(3)
    theta = np.stack([draw(model.prior(name), rng, 70) for name in model.names], axis=1)
    system = model.system(theta)
    fast, good, slow = both_routes(system)
    truth = np.array(
        [reference(structure, dict(zip(model.names, row, strict=True)), row[-1]) for row in theta]
    )
    assert good.sum() > 20
    assert relative(fast[good], truth[good]) < 1e-9
    assert relative(slow, truth) < 1e-9
    assert relative(model.response(theta, FREQUENCY), truth) < 1e-9
    one_by_one = [model.response(row, FREQUENCY) for row in theta]
    assert relative(model.response(theta, FREQUENCY), np.array(one_by_one)) < 1e-12


def pulse_response_by_small_steps(a, b, delays_s, seconds, substeps=16):
    """Positions at the samples after one period of unit force, classical Runge-Kutta."""
    count, n = len(delays_s), len(a)
    whole = np.floor(delays_s / T).astype(int)
    late = delays_s - whole * T
    maps = []
    for length in (late, T - late):
        h = (length / substeps)[:, None, None]
        ha = h * a
        # One Runge-Kutta step of a linear equation with a constant input.
        one = np.eye(n) + ha @ (np.eye(n) + ha / 2 @ (np.eye(n) + ha / 3 @ (np.eye(n) + ha / 4)))
        push = h * (np.eye(n) + ha / 2 @ (np.eye(n) + ha / 3 @ (np.eye(n) + ha / 4))) @ b[:, None]
        maps.append((one, push))
    samples = round(seconds / T)
    x, out = np.zeros((count, n, 1)), np.empty((samples, count))
    for k in range(samples):
        out[k] = x[:, 0, 0]
        for part, (one, push) in enumerate(maps):
            on = (k == whole + (1 - part)).astype(float)[:, None, None]
            for _ in range(substeps):
                x = one @ x + on * push
    return out


@pytest.mark.parametrize(
    ("device", "structure", "seconds"), [("phantom", "free", 4), ("lhifam", "grasped", 11)]
)
def test_against_brute_force_in_the_time_domain(device, structure, seconds):
    values = load_device(device).parameters[structure]
    a, b = chain_matrices(structure, values)
    delays = np.array([0.0, 0.3, 1.0, 2.3]) * T
    pulse = pulse_response_by_small_steps(a, b, delays, seconds)
    z = np.exp(2j * np.pi * FREQUENCY * T)
    settled = pulse[-1]  # the device stays where a pulse has pushed it, unless a spring holds it
    decaying = pulse - settled
    summed = np.exp(-2j * np.pi * T * np.outer(FREQUENCY, np.arange(len(pulse)))) @ decaying
    truth = (summed + settled / (1 - 1 / z[:, None])).T
    model = build_model(structure, device, delay_sd_s=1e-5)
    own = [values[name] for name in model.names[:-1]]
    theta = np.column_stack([np.tile(own, (len(delays), 1)), delays])
    assert relative(model.response(theta, FREQUENCY), truth) < 1e-6


@pytest.mark.parametrize("damping", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("delay", DELAYS)
def test_double_and_nearly_double_poles_of_a_rigid_mass(damping, delay):
    model = build_model("rigid", delay_s=delay, period_s=T)
    truth = reference("rigid", {"m": 5.39, "b": damping}, delay)
    assert relative(model.response([5.39, damping], FREQUENCY), truth) < 1e-9


@pytest.mark.parametrize("excess", [0.0, 1e-12, 1e-7, 1e-3])
def test_a_critically_damped_mode(excess):
    m, k = 0.3, 3000.0
    b = 2 * np.sqrt(m * k) * (1 + excess)
    one = np.ones(1)
    mechanism = Mechanism((m * one,), (Link(0, None, b * one, k * one),))
    a = np.array([[0, 1], [-k / m, -b / m]])
    for delay in DELAYS:
        truth = by_matrix_exponential(a, np.array([0, 1 / m]), np.array([1.0, 0]), delay)
        system = LinearSystem(mechanism, delay * one)
        assert relative(system.sampled_response(FREQUENCY, T)[0], truth) < 1e-9


def test_undamped_free_devices():
    """Rigid-body motion and mode without any damper: a double pole at zero beside a pair."""
    values = {"m1": 0.19, "b1": 0.0, "bc": 0.0, "kc": 55.3e3, "m2": 5.2, "b2": 0.0}
    model = build_model("free", delay_s=0.3 * T, period_s=T)
    truth = reference("free", values, 0.3 * T)
    assert relative(model.response(list(values.values()), FREQUENCY), truth) < 1e-9


@pytest.mark.parametrize("kc", [1.5e6, 1.5e7])
def test_undamped_free_devices_with_a_fast_mode(kc):
    """The same where the pole form has to do: two poles at zero had no residues."""
    values = {"m1": 0.19, "b1": 0.0, "bc": 20.0, "kc": kc, "m2": 5.2, "b2": 0.0}
    model = build_model("free", delay_s=0.3 * T, period_s=T)
    truth = reference("free", values, 0.3 * T)
    assert relative(model.response(list(values.values()), FREQUENCY), truth) < 1e-7


@pytest.mark.parametrize("structure", ["free", "grasped"])
def test_fast_modes_are_handed_over_to_the_pole_form(structure):
    """Modes from 300 to 3000 rad/s: the series is used below, the poles above, both exact."""
    values = load_device("lhifam").parameters[structure]
    model = build_model(structure, "lhifam", delay_s=0.2 * T)
    theta = np.tile(model.values, (40, 1))
    theta[:, model.names.index("kc")] *= np.geomspace(0.3, 30, 40)
    _, good, _ = both_routes(model.system(theta))
    assert good[0] and not good[-1]
    edge = np.flatnonzero(~good)[0]
    assert 3 < edge < 37 and not good[edge:].any()
    truth = np.array([reference(structure, {**values, "kc": kc}, 0.2 * T) for kc in theta[:, 3]])
    assert relative(model.response(theta, FREQUENCY), truth) < 1e-9


def test_the_series_is_used_further_where_the_band_is_narrow():
    model = build_model("free", "lhifam")
    theta = model.values[None] * np.where(np.array(model.names) == "kc", 12, 1)
    frequency = np.geomspace(0.3, 150, 40)
    assert not both_routes(model.system(theta))[1][0]
    fast, good, slow = both_routes(model.system(theta), frequency)
    assert good[0]
    assert relative(fast, slow) < 1e-9


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("tau", [5e-4, 5e-3])
def test_filters_in_series(order, tau):
    values = load_device("lhifam").parameters["grasped"]
    model = build_model("grasped", "lhifam")
    system = model.system(model.values)
    bottom = {1: [tau, 1], 2: [tau**2, 1.2 * tau, 1]}[order]
    column = np.array(bottom[::-1])[:, None]
    system = system.with_filter(np.ones((1, 1)), column)
    a, b = chain_matrices("grasped", values)
    af, bf, cf, _ = tf2ss([1], bottom)
    n, k = len(a), len(af)
    both = np.zeros((n + k, n + k))
    both[:n, :n], both[n:, n:] = a, af
    both[n:, 0] = bf[:, 0]  # the filter reads the position
    c = np.append(np.zeros(n), cf[0])
    truth = by_matrix_exponential(both, np.append(b, np.zeros(k)), c, 0.2e-3)
    assert relative(system.sampled_response(FREQUENCY, T)[0], truth) < 1e-9
    if tau == 5e-3:  # slow enough for the series, whatever the order of the filter
        assert both_routes(system)[1][0]


@pytest.mark.parametrize("period", [4e-4, 1e-3, 5e-3])
def test_other_periods(period):
    values = load_device("phantom").parameters["grasped"]
    frequency = np.geomspace(1e-3, 0.4999, 50) / period
    for delay in (0.0, 1.7 * period):
        model = build_model("grasped", "phantom", delay_s=delay, period_s=period)
        truth = reference("grasped", values, delay, frequency, period)
        assert relative(model.response(model.values, frequency), truth) < 1e-9


def test_more_masses_and_another_place_of_the_motor():
    """A fourth mass on the body, which is what the motor pushes."""
    rng = np.random.default_rng(0)
    m = rng.uniform(0.5, 2, 4)
    ends = [(0, 1), (1, 2), (1, 3), (2, None)]
    k, b = rng.uniform(2e3, 4e4, 4), rng.uniform(1, 30, 4)
    one = np.ones(1)
    links = tuple(Link(i, j, b[e] * one, k[e] * one) for e, (i, j) in enumerate(ends))
    mechanism = Mechanism(tuple(mass * one for mass in m), links, driven=1)
    stiffness, damping = np.zeros((4, 4)), np.zeros((4, 4))
    for matrix, value in ((stiffness, k), (damping, b)):
        for e, (i, j) in enumerate(ends):
            pair = np.zeros(4)
            pair[i] = 1
            if j is not None:
                pair[j] = -1
            matrix += value[e] * np.outer(pair, pair)
    a = np.block([[np.zeros((4, 4)), np.eye(4)], [-stiffness / m[:, None], -damping / m[:, None]]])
    assert np.allclose(mechanism.state_matrix()[0], a)
    drive, read = np.zeros(8), np.zeros(8)
    drive[5], read[1] = 1 / m[1], 1
    system = LinearSystem(mechanism, np.array([0.4 * T]))
    truth = by_matrix_exponential(a, drive, read, 0.4 * T)
    assert relative(system.sampled_response(FREQUENCY, T)[0], truth) < 1e-9


@pytest.mark.parametrize("structure", ["free", "grasped"])
def test_the_continuous_approximation(structure):
    """P(s) e^{-s (td + T/2)}; it misses the hold's sinc factor and the aliases."""
    values = load_device("lhifam").parameters[structure]
    model = build_model(structure, "lhifam")
    a, b = chain_matrices(structure, values)
    s = 2j * np.pi * FREQUENCY
    continuous = np.linalg.solve(s[:, None, None] * np.eye(len(a)) - a, b[:, None])[:, 0, 0]
    approximation = model.response(model.values, FREQUENCY, "continuous")
    assert relative(approximation, continuous * np.exp(-s * 0.7e-3)) < 1e-9
    exact = model.response(model.values, FREQUENCY)
    low = FREQUENCY < 30
    sinc = np.sinc(FREQUENCY * T)
    assert relative(approximation[low] * sinc[low], exact[low]) < 5e-3
    assert relative(approximation[~low], exact[~low]) > 0.1


@pytest.mark.parametrize("lag_s", [0.0, 1e-5, 1e-2])
def test_poles_at_one_place_are_no_error(lag_s):
    """Nothing holds it, and a mode is too fast for the series: two poles at zero."""
    one = np.ones(2)
    links = (Link(0, 1, 0.1 * one, np.array([1e3, 1e9])), Link(0, None, 0 * one, 0 * one))
    system = LinearSystem(Mechanism((one, one), links), 1e-3 * one)
    if lag_s:
        system = system.with_filter(one[None], np.stack([one, lag_s * one]))
    found = system.sampled_response(FREQUENCY, T)
    slow = FREQUENCY < 1
    assert np.isfinite(found).all()
    # Both are one mass of 2 kg there, but for what the softer spring gives: omega^2 m / (2 k).
    assert relative(found[1, slow], found[0, slow]) < 1.05 * (2 * np.pi) ** 2 / 2e3
