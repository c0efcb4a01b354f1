"""Poles and residues of rational functions: of poles that coincide, too."""

from __future__ import annotations

import numpy as np

from bayeshaptic.numerics.polynomials.polynomial import Polynomial, evaluate
from bayeshaptic.types import Complexes, Floats


def moved_apart(poles: Complexes, least: float = 0.0) -> Complexes:
    """Poles, shape (B, n), of which m that all but coincide are moved apart by 2 h each.

    Across the real axis, so that pairs stay pairs.  That changes the denominator by some h^2
    relative to |s - p|^2 and costs eps / h^(m-1) in rounding, both relative to |p|, which
    h = eps^(1/(m+1)) |p| / 4 balances: far below 1e-7 wherever a response matters.

    Parameters
    ----------
    poles : ndarray of complex, shape (B, n)
    least : float
        Least h, in the unit of the poles: beside zero.
    """
    eps, size = np.finfo(float).eps, np.abs(poles)
    own = np.eye(poles.shape[1], dtype=bool)
    smallest = np.maximum(0.25 * eps ** (1 / 3) * size, least)
    near = ~own & (np.abs(_gaps(poles)) < smallest[:, :, None])
    rows = np.flatnonzero(near.any(axis=(1, 2)))
    if not rows.size:
        return poles
    near, moved = near[rows], poles.copy()
    others = near.sum(axis=2)
    h = np.maximum(0.25 * eps ** (1 / (others + 2)) * size[rows], least)
    moved[rows] += 2j * (np.tril(near, -1).sum(axis=2) - 0.5 * others) * h
    return moved


def residues(numerator: Polynomial, leading: Floats, poles: Complexes) -> Complexes:
    """Residues at simple `poles`, shape (B, n).

    Parameters
    ----------
    numerator : ndarray, shape (degree + 1, B)
    leading : ndarray, shape (B,)
        Coefficient of the highest power of the denominator.
    poles : ndarray of complex, shape (B, n)
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return evaluate(numerator, poles.T).T / (leading[:, None] * _gaps(poles).prod(axis=2))


def _gaps(poles: Complexes) -> Complexes:
    """p_i - p_j, and 1 on the diagonal, shape (B, n, n)."""
    gaps = poles[:, :, None] - poles[:, None, :]
    diagonal = np.arange(poles.shape[1])
    gaps[:, diagonal, diagonal] = 1.0
    return gaps
