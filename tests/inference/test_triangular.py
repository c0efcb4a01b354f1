"""Least squares from a triangle, of many systems at once."""

from __future__ import annotations

import numpy as np

from bayeshaptic.numerics.triangular import back_substituted


def test_it_solves_what_least_squares_solve() -> None:
    rng = np.random.default_rng(1)
    columns = rng.normal(size=(7, 12, 4)) + 1j * rng.normal(size=(7, 12, 4))
    target = rng.normal(size=(7, 12)) + 1j * rng.normal(size=(7, 12))
    triangle = np.asarray(np.linalg.qr(np.concatenate([columns, target[..., None]], -1), mode="r"))
    found = back_substituted(triangle[:, :4, :4], triangle[:, :4, 4])
    plain = [np.linalg.lstsq(a, b, rcond=None)[0] for a, b in zip(columns, target, strict=True)]
    np.testing.assert_allclose(found, plain, rtol=1e-12)


def test_a_column_that_others_make_up_for_is_left_out() -> None:
    """As the denominator of a response that is a parabola already."""
    rng = np.random.default_rng(2)
    columns = rng.normal(size=(1, 12, 3)) + 0j
    both = np.concatenate([columns, 2 * columns[..., :1], columns @ np.ones((3, 1))], axis=-1)
    triangle = np.asarray(np.linalg.qr(both, mode="r"))
    found = back_substituted(triangle[:, :4, :4], triangle[:, :4, 4])
    np.testing.assert_allclose(found, [[1, 1, 1, 0]], atol=1e-12)
