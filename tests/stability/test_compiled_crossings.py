"""The compiled search for crossings and its poles against the plain forms beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plain_response import from_poles

from bayeshaptic.models.build import build_model
from bayeshaptic.numerics.polynomials.polynomial import evaluate, multiply, roots
from bayeshaptic.numerics.polynomials.roots import find_roots
from bayeshaptic.stability.crossings import _compiled_search, find_crossings, plain_search
from bayeshaptic.stability.responses.response import PoleResponse, pole_response
from bayeshaptic.types import Complexes, Floats, Ints

T = 1e-3
CASES = [
    (device, structure) for device in ("lhifam", "phantom") for structure in ("free", "grasped")
]
CASES += [("lhifam", "rigid")]


def loops(device: str, structure: str, count: int = 300, seed: int = 5):
    """With small dampers, delays up to three periods, and lags.

    Where dampers to the ground vanish, the poles at and beside zero cancel each other, and both
    forms lose as many digits.
    """
    rng = np.random.default_rng(seed)
    model = build_model(structure, device, delay_sd_s=1e-4)
    theta = model.values * np.exp(0.5 * rng.standard_normal((count, model.size)))
    for name in ("b", "b1", "b2"):
        if name in model.names:
            theta[:, model.names.index(name)] *= 10.0 ** rng.uniform(-2, 0, count)
    theta[:, -1] = rng.uniform(0, 3 * T, count)
    lag = rng.uniform(0, 1e-3, count)
    system = model.system(theta)
    return system.with_filter(np.ones((1, count)), np.stack([np.ones(count), lag + 1e-6]))


@pytest.mark.parametrize(("device", "structure"), CASES)
def test_the_compiled_terms_of_the_poles_are_those_of_the_plain_form(device, structure) -> None:
    system = loops(device, structure)
    response = pole_response(system, T)
    theta = np.geomspace(1e-3, 3.1, 40)
    rows = np.arange(system.batch)
    found = response.at(rows, np.tile(theta, (system.batch, 1)))
    poles, residues = response.poles / T, response.residues / T
    plain = from_poles(poles, residues, system.delay_s, theta / (2 * np.pi * T), T)
    size = np.abs(pole_terms(response, rows, np.tile(theta, (system.batch, 1)))).sum(axis=0)
    assert np.max(np.abs(found - plain) / size) < 1e-12


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(("device", "structure"), CASES)
def test_the_compiled_search_finds_what_the_plain_one_does(device, structure, exact) -> None:
    response = pole_response(loops(device, structure), T, exact)
    found, plain = (
        below_nyquist(*_compiled_search(response)),
        below_nyquist(*plain_search(response)),
    )
    assert len(found) > 300
    assert np.array_equal(found[:, 0], plain[:, 0])
    np.testing.assert_allclose(found[:, 1:], plain[:, 1:], rtol=1e-9)


def pole_terms(response: PoleResponse, rows: Ints, theta: Floats) -> Complexes:
    """The contribution of each pole, shape (n, M, k); their sum is `response.at`."""
    half = np.exp(0.5j * theta)
    back = np.conj(half) ** 2
    point = 2j * np.sin(0.5 * theta) * half if response.exact else 1j * theta
    tables = response.direct, response.late, response.centre
    direct, late, centre = (table[rows].T[:, :, None] for table in tables)
    turned = np.exp(-1j * theta * response.delay[rows][:, None])
    return (direct + late * back) / (point - centre) * turned


def below_nyquist(row, theta, gain) -> np.ndarray:
    """What counts, sorted; the end of the grid is looked at once more by itself."""
    used = (gain < 0) & (theta < np.pi * (1 - 1e-6))
    return np.array(sorted(zip(row[used], theta[used], gain[used], strict=True)))


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(("device", "structure"), CASES)
def test_compiled_values_are_the_sum_over_the_poles(device, structure, exact) -> None:
    response = pole_response(loops(device, structure), T, exact)
    rows = np.array([7, 0, 7, 299])
    theta = np.geomspace(1e-5, np.pi, 4 * 50).reshape(50, 4).T
    terms = pole_terms(response, rows, theta)
    # Slow poles cancel each other at low frequencies: digits are lost against the largest term.
    left = np.abs(response.at(rows, theta) - terms.sum(axis=0))
    assert np.all(left < 1e-14 * len(terms) * np.abs(terms).sum(axis=0))


def test_the_stiffness_of_a_loop_does_not_depend_on_the_batch_around_it() -> None:
    system = loops("lhifam", "grasped", count=20)
    together = find_crossings(system, T).critical
    alone = [find_crossings(system.rows(slice(k, k + 1)), T).critical[0] for k in range(20)]
    np.testing.assert_allclose(together, alone, rtol=1e-12)


def test_a_crossing_far_below_any_band_is_found() -> None:
    """As the dampers vanish, the rigid-body crossing of a free device goes to zero."""
    model = build_model("free", "lhifam")
    for damper in (1e-2, 1e-4, 1e-6):
        values = dict(zip(model.names, model.values, strict=True), b1=damper, b2=damper)
        found = find_crossings(model.system([values[name] for name in model.names]), T)
        delay = model.fixed["delay_s"]
        assert found.critical[0] == pytest.approx(2 * damper / (delay + T / 2), rel=1e-3)


def polynomial(roots: np.ndarray) -> np.ndarray:
    out = np.ones((1, 1))
    for root in roots:
        if root.imag > 0:
            out = multiply(out, np.array([[abs(root) ** 2], [-2 * root.real], [1.0]]))
        elif root.imag == 0:
            out = multiply(out, np.array([[-root.real], [1.0]]))
    return out[:, 0]


@pytest.mark.parametrize(
    "truth",
    [
        [-3.0],
        [0, 0, -1e-9, -1e3],
        [-1e-6, -0.1, -0.01 + 0.6j, -0.01 - 0.6j, -1 + 3j, -1 - 3j],
        [1e-5 + 2j, 1e-5 - 2j, -5 + 0j, -7, -700],
        10.0 ** np.arange(-8, 8) * -1.0,
    ],
)
def test_roots_each_relative_to_itself(truth) -> None:
    truth = np.sort_complex(np.array(truth, complex))
    found, settled = np.empty((1, len(truth)), complex), np.empty(1, bool)
    find_roots(polynomial(truth)[None], found, settled)
    assert settled[0]
    np.testing.assert_allclose(np.sort_complex(found[0]), truth, rtol=1e-12, atol=0)
    assert np.array_equal(np.sort_complex(found[0]), np.sort_complex(found[0].conj()))


def test_double_roots_and_what_is_no_number() -> None:
    rows = np.array([[1.0, 2.0, 1.0], [np.nan, 1.0, 1.0], [1.0, 1.0, 0.0]])
    found, settled = np.empty((3, 2), complex), np.empty(3, bool)
    find_roots(rows, found, settled)
    assert settled.tolist() == [True, False, False]
    np.testing.assert_allclose(found[0], -1.0, atol=1e-7)  # half the digits, as any method


def test_a_long_delay_has_many_crossings() -> None:
    """Two hundred periods turn the phase past -180 degrees a hundred times."""
    system = loops("lhifam", "rigid", count=3)
    system = replace(system, delay_s=np.array([1e-3, 0.2, 1e-3]))
    response = pole_response(system, T)
    found, plain = (
        below_nyquist(*_compiled_search(response)),
        below_nyquist(*plain_search(response)),
    )
    assert np.sum(found[:, 0] == 1) > 90
    np.testing.assert_allclose(found, plain, rtol=1e-9)


def test_one_and_two_roots_in_closed_form_are_as_exact_as_the_coefficients() -> None:
    rng = np.random.default_rng(3)
    for degree in (1, 2):
        size = (degree + 1, 1000)
        c = rng.standard_normal(size) * 10 ** rng.uniform(-4, 4, size)
        c[:-1, 0] = 0.0  # all at zero
        found = roots(c).T
        sizes = evaluate(np.abs(c), np.abs(found).astype(complex)).real
        assert np.all(np.abs(evaluate(c, found)) <= 1e-15 * sizes)


def test_roots_of_what_is_no_number_are_none_and_warn_of_nothing():
    found = roots(np.array([[np.nan, np.inf, 2.0], [1.0, np.inf, 3.0], [1.0, 1.0, 1.0]]))
    assert not np.isfinite(found[:2]).all(axis=1).any()
    np.testing.assert_allclose(np.sort(found[2].real), [-2.0, -1.0], rtol=1e-12)
