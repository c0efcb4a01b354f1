"""Mechanisms on a frame, dynamic links, fast filters: each against the slow and obvious sum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayeshaptic.effects.linear.reflex import reflex_stiffness
from bayeshaptic.models import LinearSystem, build_model
from bayeshaptic.models.response.aliases import aliases
from bayeshaptic.models.response.dynamic_link import DynamicLink
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.numerics.polynomials.polynomial import evaluate
from bayeshaptic.stability import find_crossings
from bayeshaptic.stability.crossings import search
from bayeshaptic.stability.responses.evaluated import EvaluatedResponse

T = 1e-3
FREQUENCY_HZ = np.geomspace(0.3, 480, 50)
DEVICES = [(device, name) for device in ("lhifam", "phantom") for name in ("free", "grasped")]


def late(s, stiffness, damping, delay_s, lag_s):
    return (stiffness + damping * s) * np.exp(-s * delay_s) / (1 + s * lag_s)


def hysteretic(s, stiffness, rate, power):
    turn = np.where(s.imag < 0, np.exp(-0.5j * np.pi * power), np.exp(0.5j * np.pi * power))
    return stiffness * ((np.abs(s) / rate) ** power * turn - 1)


def plain(device, name, batch=1, log_sd=0.2, seed=5):
    model = build_model(name, device)
    noise = np.random.default_rng(seed).normal(size=(batch, model.size))
    theta = model.values * np.exp(log_sd * noise)
    return model.system(theta), dict(zip(model.names, theta.T, strict=True))


def linked(device, name, **options):
    """With a lossy transmission, and a reflex where there is a hand."""
    system, v = plain(device, name, **options)
    rate = np.sqrt(v["kc"] * (1 / v["m1"] + 1 / v["m2"]))
    power = np.full_like(rate, 0.1)
    system = system.with_dynamic_link(DynamicLink(0, 1, hysteretic, (v["kc"], rate, power)))
    if "kh" in v:
        delay_s, lag_s = np.full_like(rate, 0.03), np.full_like(rate, 0.01)
        reflex = DynamicLink(2, None, late, (0.5 * v["kh"], 0.5 * v["bh"], delay_s, lag_s))
        system = system.with_dynamic_link(reflex)
    return system


def filtered(system, *lags_s):
    one = np.ones(system.batch)
    for lag_s in lags_s:
        system = system.with_filter(one[None], np.stack([one, lag_s * one]))
    return system


def on_a_base(system: LinearSystem) -> LinearSystem:
    mass = 20 * system.mechanism.masses[0]
    mechanism = system.mechanism.with_frame(mass, 5 * mass, 1e4 * mass)
    return replace(system, mechanism=mechanism)


def matrix_response(system: LinearSystem, s: np.ndarray) -> np.ndarray:
    """P(s) of the first of the batch from the dynamic stiffness matrix, numerically."""
    mechanism = system.mechanism
    n = len(mechanism.masses)
    matrix = np.zeros((*s.shape, n, n), complex)
    for i, mass in enumerate(mechanism.masses):
        matrix[..., i, i] += mass[0] * s**2
    joints = [(k.first, k.second, k.damping[0] * s + k.stiffness[0]) for k in mechanism.links]
    joints += [(k.first, k.second, k.stiffness(s[..., None])[..., 0]) for k in system.dynamic_links]
    for i, j, stiffness in joints:
        matrix[..., i, i] += stiffness
        if j is not None:
            matrix[..., j, j] += stiffness
            matrix[..., i, j] -= stiffness
            matrix[..., j, i] -= stiffness
    drive = mechanism.drive_vector()
    push = np.broadcast_to(drive, (*s.shape, n))[..., None]
    response = np.linalg.solve(matrix, push)[..., 0] @ drive
    for factor in system.filters:
        response = response * np.polyval(factor.numerator[::-1, 0], s)
        response = response / np.polyval(factor.denominator[::-1, 0], s)
    return response


def alias_sum(system: LinearSystem, frequency_hz: np.ndarray, aliases: int = 3000) -> np.ndarray:
    s = 2j * np.pi * frequency_hz
    every = s[:, None] + 2j * np.pi * np.arange(-aliases, aliases + 1) / T
    terms = np.exp(-every * system.delay_s[0]) * matrix_response(system, every) / every
    return (1 - np.exp(-s * T)) / T * terms.sum(axis=1)


def error(system: LinearSystem, frequency_hz: np.ndarray = FREQUENCY_HZ) -> float:
    mine = system.sampled_response(frequency_hz, T)[0]
    return float(np.max(np.abs(mine / alias_sum(system, frequency_hz) - 1)))


# ---------------------------------------------------------------- mechanisms


@pytest.mark.parametrize(("device", "name"), DEVICES)
def test_transfer_functions_of_any_arrangement(device, name):
    system, _ = plain(device, name)
    mass = 0.3 * system.mechanism.masses[0]
    hung = system.mechanism.with_mass(mass, 1, 5 * mass, 1e5 * mass)
    for mechanism in (system.mechanism, hung, hung.with_frame(9 * mass, mass, 1e4 * mass)):
        here = LinearSystem(mechanism, system.delay_s)
        s = 2j * np.pi * FREQUENCY_HZ
        np.testing.assert_allclose(
            here.continuous_response(s)[0], matrix_response(here, s), rtol=1e-9
        )
        numerator, denominator = mechanism.transfer()
        assert (len(numerator), len(denominator)) == (
            2 * len(mechanism.masses) - 1, 2 * len(mechanism.masses) + 1,
        )  # fmt: skip
        for other in range(len(mechanism.masses)):
            if other != mechanism.frame:
                top, bottom = mechanism.transfer_to(other)
                motion = (evaluate(top, s[:, None]) / evaluate(bottom, s[:, None]))[:, 0]
                np.testing.assert_allclose(motion, _motion(mechanism, s, other), rtol=1e-7)


def _motion(mechanism: Mechanism, s: np.ndarray, mass: int) -> np.ndarray:
    """Position of a mass, from the frame, by the state matrix."""
    n = len(mechanism.masses)
    push = np.zeros(2 * n)
    push[n:] = mechanism.drive_vector() / np.array([m[0] for m in mechanism.masses])
    matrix = s[:, None, None] * np.eye(2 * n) - mechanism.state_matrix()[0]
    x = np.linalg.solve(matrix, push[:, None])[..., 0]
    return x[:, mass] - (0 if mechanism.frame is None else x[:, mechanism.frame])


def test_rigid_body_stays_an_exact_zero_whatever_is_hung_on():
    system, _ = plain("lhifam", "free", batch=200, log_sd=1.0)
    mass = system.mechanism.masses[0]
    mechanism = system.mechanism
    for on in (0, 1, 2):
        mechanism = mechanism.with_mass(0.37 * mass, on, 1.3 * mass, 1e5 * mass)
    assert np.all(mechanism.transfer()[1][0] == 0)
    assert np.all(find_crossings(LinearSystem(mechanism, system.delay_s), T).critical > 0)


def test_a_heavy_base_is_the_ground():
    system, _ = plain("lhifam", "grasped")
    heavy = np.array([1e12])
    mechanism = system.mechanism.with_frame(heavy, heavy, heavy)
    base = LinearSystem(mechanism, system.delay_s)
    np.testing.assert_allclose(
        base.sampled_response(FREQUENCY_HZ, T), system.sampled_response(FREQUENCY_HZ, T), rtol=1e-9
    )


# ---------------------------------------------------------------- dynamic links


@pytest.mark.parametrize(("device", "name"), DEVICES)
def test_dynamic_links_against_the_sum_over_aliases(device, name):
    system = linked(device, name)
    assert not system.rational
    late_loop = replace(system, delay_s=np.array([2.6 * T]))
    for variant in (system, late_loop, filtered(system, 3e-4), on_a_base(system)):
        assert error(variant) < 1e-7
        plain_error = np.abs(
            variant.sampled_response(FREQUENCY_HZ, T)
            / variant.rational_part.sampled_response(FREQUENCY_HZ, T)
            - 1
        )
        assert plain_error.max() > 0.05


def test_few_frequencies_are_summed_term_by_term():
    system = linked("lhifam", "grasped")
    some = FREQUENCY_HZ[::11]
    np.testing.assert_allclose(
        system.sampled_response(some, T),
        system.sampled_response(FREQUENCY_HZ, T)[:, ::11],
        rtol=1e-8,
    )


def test_one_link_is_compiled_as_it_is_written():
    system = filtered(linked("lhifam", "grasped"), 3e-4)
    one = replace(system, dynamic_links=system.dynamic_links[:1]).remainder
    omega = np.concatenate([np.geomspace(0.1, 3e3, 50), -np.geomspace(3e3, 6e4, 50)])
    s = 1j * omega[:, None]
    np.testing.assert_allclose(one.on_axis(omega), one.at(s) / s, rtol=1e-12)
    own = np.exp(np.random.default_rng(1).uniform(0, 9, (40, system.batch)))  # of each vector
    np.testing.assert_allclose(one.on_axis(own), one.at(1j * own) / (1j * own), rtol=1e-12)
    (link,), compliance = one.links, evaluate(one.compliances[1, 1], 1j * own)
    ratio = compliance / evaluate(one.denominator, 1j * own)
    difference = 1 + link.stiffness(1j * own) * ratio
    np.testing.assert_allclose(one.return_difference(own), difference, rtol=1e-11)


@pytest.mark.parametrize("count", [2, 3])
def test_several_links_are_compiled_as_they_are_written(count):
    system = filtered(linked("lhifam", "grasped"), 3e-4)
    links = (*system.dynamic_links, *system.dynamic_links)[:count]
    several = replace(system, dynamic_links=links).remainder
    own = np.exp(np.random.default_rng(1).uniform(0, 9, (40, system.batch)))  # of each vector
    s = 1j * own
    np.testing.assert_allclose(several.on_axis(own), several.at(s) / s, rtol=1e-10)
    # All at once: det(1 + Lambda H), H the compliances between their pairs of masses.
    h = np.empty((*own.shape, count, count), complex)
    for (i, j), numerator in several.compliances.items():
        if i > 0:
            h[..., i - 1, j - 1] = evaluate(numerator, s) / evaluate(several.denominator, s)
            h[..., j - 1, i - 1] = h[..., i - 1, j - 1]
    stiffness = np.stack([link.stiffness(s) for link in several.links], axis=-1)
    whole = np.linalg.det(np.eye(count) + stiffness[..., None] * h)
    np.testing.assert_allclose(several.return_difference(own), whole, rtol=1e-9)


def test_aliases_hold_and_delay_are_compiled_as_they_are_written():
    system = linked("lhifam", "grasped")
    remainder, batch = system.remainder, system.batch
    series = aliases(remainder, np.pi, system.delay_s, T)
    theta = np.pi * np.exp(-np.random.default_rng(4).uniform(0, 20, (30, 5)))
    rows, turns = np.arange(5) % batch, system.delay_s[np.arange(5) % batch] / T
    values = remainder.rows(rows).on_axis(theta / T)
    plain = -np.expm1(-1j * theta) / T * np.exp(-1j * theta * turns)
    plain = plain * (values + series.at(theta, rows))
    mine = series.sampled(values, theta, rows, turns, T)
    np.testing.assert_allclose(mine, plain, rtol=1e-12)


@pytest.mark.parametrize("columns", [1, 7])
def test_a_reflex_is_compiled_as_it_is_written(columns):
    values = np.geomspace(0.5, 2.0, 7) * np.array([[300.0], [4.0], [0.03], [0.01]])
    omega = np.random.default_rng(2).uniform(-6e4, 6e4, (40, columns))
    mine, plain = reflex_stiffness(1j * omega, *values), late(1j * omega, *values)
    np.testing.assert_allclose(mine, plain, rtol=1e-11)


def test_vectors_that_are_no_numbers_leave_the_others_alone():
    system = linked("lhifam", "grasped").rows(np.zeros(3, int))
    broken = system.mechanism.masses[0] * [1.0, np.nan, 1.0]
    mechanism = replace(system.mechanism, masses=(broken, *system.mechanism.masses[1:]))
    with np.errstate(all="ignore"):
        found = replace(system, mechanism=mechanism).sampled_response(FREQUENCY_HZ, T)
    assert np.isnan(found[1]).all()
    np.testing.assert_allclose(found[[0, 2]], system.sampled_response(FREQUENCY_HZ, T)[:2])


def test_mechanism_too_fast_for_the_series():
    system = linked("lhifam", "grasped")
    mass = 0.1 * system.mechanism.masses[0]
    rate = 2 * np.pi * 420
    mechanism = system.mechanism.with_mass(mass, 0, 0.05 * mass * rate, mass * rate**2)
    assert error(replace(system, mechanism=mechanism)) < 1e-6


def test_two_links_at_one_place_are_one_of_the_sum():
    system, v = plain("lhifam", "free")
    rate, power = np.full(1, 500.0), np.full(1, 0.1)

    def link(share):
        return DynamicLink(0, 1, hysteretic, (share * v["kc"], rate, power))

    twice = system.with_dynamic_link(link(0.3)).with_dynamic_link(link(0.7))
    once = system.with_dynamic_link(link(1.0))
    np.testing.assert_allclose(
        twice.sampled_response(FREQUENCY_HZ, T), once.sampled_response(FREQUENCY_HZ, T), rtol=1e-9
    )


def test_a_spring_and_a_damper_as_a_dynamic_link():
    def solid(s, damping, stiffness):
        return damping * s + stiffness

    system, v = plain("lhifam", "grasped", batch=60)
    index = next(
        n for n, k in enumerate(system.mechanism.links) if (k.first, k.second) == (2, None)
    )
    links = list(system.mechanism.links)
    half = replace(links[index], damping=0.5 * v["bh"], stiffness=0.5 * v["kh"])
    links[index] = half
    softer = replace(system, mechanism=replace(system.mechanism, links=tuple(links)))
    same = softer.with_dynamic_link(DynamicLink(2, None, solid, (half.damping, half.stiffness)))
    np.testing.assert_allclose(
        same.sampled_response(FREQUENCY_HZ, T), system.sampled_response(FREQUENCY_HZ, T), rtol=1e-8
    )
    mine, known = find_crossings(same, T), find_crossings(system, T)
    np.testing.assert_allclose(mine.critical, known.critical, rtol=1e-8)
    np.testing.assert_allclose(mine.frequency_hz, known.frequency_hz, rtol=1e-7)


@pytest.mark.parametrize("ends", [(0, 1), (1, None), (0, None)])
@pytest.mark.parametrize("based", [False, True])
def test_a_ratio_of_polynomials_is_one_more_pole(ends, based):
    """Times from far below a sample, whose poles have the closed form, to seconds."""

    def relaxing(s, stiffness, time_s):
        return stiffness * s * time_s / (1 + s * time_s)

    system, v = plain("lhifam", "grasped", batch=40)
    system = filtered(on_a_base(system) if based else system, np.full(40, 3e-4))
    time_s, nothing, one = np.geomspace(1e-7, 3.0, 40), np.zeros(40), np.ones(40)
    stiffness = np.tile([0.01, 1.0], 20) * v["kc"]
    ratio = np.stack([nothing, stiffness * time_s]), np.stack([one, time_s])
    link = DynamicLink(*ends, relaxing, (stiffness, time_s), ratio)
    summed = system.with_dynamic_link(replace(link, ratio=None))
    mine = system.with_dynamic_link(link)
    assert mine.has_rational_form and not summed.has_rational_form
    assert not mine.with_dynamic_link(link).has_rational_form
    np.testing.assert_allclose(
        mine.sampled_response(FREQUENCY_HZ, T), summed.sampled_response(FREQUENCY_HZ, T), rtol=1e-7
    )
    rows = np.arange(3, 30, 5)
    np.testing.assert_array_equal(
        mine.rows(rows).sampled_response(FREQUENCY_HZ, T),
        mine.sampled_response(FREQUENCY_HZ, T)[rows],
    )
    mine, summed = find_crossings(mine, T), find_crossings(summed, T)
    np.testing.assert_allclose(mine.critical, summed.critical, rtol=1e-7)
    np.testing.assert_allclose(mine.binding_hz, summed.binding_hz, rtol=1e-6)


@pytest.mark.parametrize("approximation", ["exact", "continuous"])
@pytest.mark.parametrize(("device", "name"), DEVICES)
def test_crossings_with_dynamic_links_by_the_response_alone(device, name, approximation):
    system = linked(device, name, batch=4, log_sd=0.4)
    mine = find_crossings(system, T, approximation)
    slow = search(EvaluatedResponse(system, T, approximation == "exact"), T)
    np.testing.assert_allclose(mine.stiffness, slow.stiffness, rtol=1e-8)
    np.testing.assert_allclose(mine.frequency_hz, slow.frequency_hz, rtol=1e-8)


def test_crossings_with_a_mode_above_the_series_and_one_below():
    system = linked("lhifam", "grasped", batch=2)
    mass = 0.1 * system.mechanism.masses[0]
    rate = 2 * np.pi * np.array([110.0, 420.0])
    mechanism = system.mechanism.with_mass(mass, 0, 0.05 * mass * rate, mass * rate**2)
    system = replace(system, mechanism=mechanism)
    slow = search(EvaluatedResponse(system, T), T)
    np.testing.assert_allclose(find_crossings(system, T).critical, slow.critical, rtol=1e-6)


def test_reflex_strong_enough_to_shake_the_hand_by_itself_leaves_no_stiffness():
    system, v = plain("lhifam", "grasped", log_sd=0.0)

    def with_reflex(share):
        values = (share * v["kh"], share * v["bh"], np.array([0.05]), np.array([0.01]))
        return system.with_dynamic_link(DynamicLink(2, None, late, values))

    assert find_crossings(with_reflex(0.3), T).critical > 0
    assert find_crossings(with_reflex(8.0), T).critical == 0


# ---------------------------------------------------------------- fast filters


@pytest.mark.parametrize(("device", "name"), DEVICES)
@pytest.mark.parametrize(
    "lags_s", [(1e-3,), (3e-4,), (2e-6,), (3e-4, 3.001e-4), (2e-4, 5e-4, 2e-3)], ids=str
)
def test_filters_against_the_sum_over_aliases(device, name, lags_s):
    assert error(filtered(plain(device, name)[0], *lags_s)) < 1e-9


@pytest.mark.parametrize("damping", [0.05, 0.7, 1.0, 3.0])
def test_filter_of_order_two_against_the_sum_over_aliases(damping):
    system, _ = plain("lhifam", "grasped")
    one, rate = np.ones(1), 2 * np.pi * 400.0
    bottom = np.stack([one, 2 * damping / rate * one, one / rate**2])
    # At a damping of exactly 1 the two equal poles are moved apart.
    assert error(system.with_filter(one[None], bottom)) < (1e-7 if damping == 1.0 else 1e-9)


def test_fast_and_slow_filters_in_one_batch():
    system, _ = plain("lhifam", "grasped", batch=90)
    lag_s = np.geomspace(1e-5, 1e-2, 90)
    both = system.with_filter(np.ones((1, 90)), np.stack([np.ones(90), lag_s]))
    response = both.sampled_response(FREQUENCY_HZ, T)
    for row in (0, 44, 60, 89):
        one = both.rows(slice(row, row + 1))
        np.testing.assert_allclose(
            one.sampled_response(FREQUENCY_HZ, T)[0], response[row], rtol=1e-9
        )
        assert error(one) < 1e-9
