"""Least squares from a triangle: what a QR leaves to solve, of many systems at once."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Complexes


def back_substituted(triangle: Complexes, target: Complexes, least: float = 1e-12) -> Complexes:
    """Solve R x = z, from the last unknown to the first.

    Parameters
    ----------
    triangle : complex ndarray, shape (..., k, k)
        Upper triangular.
    target : complex ndarray, shape (..., k)
    least : float
        Diagonals below this share of the largest belong to columns that those before them make up
        for: their unknowns are zero.

    Returns
    -------
    complex ndarray, shape (..., k)
    """
    diagonal = np.diagonal(triangle, axis1=-2, axis2=-1)
    size = np.abs(diagonal)
    told = size > least * size.max(axis=-1, keepdims=True)
    inverse = np.where(told, 1 / np.where(told, diagonal, 1.0), 0.0)
    found = np.zeros_like(target)
    for row in reversed(range(target.shape[-1])):
        known = np.sum(triangle[..., row, row + 1 :] * found[..., row + 1 :], axis=-1)
        found[..., row] = (target[..., row] - known) * inverse[..., row]
    return found
