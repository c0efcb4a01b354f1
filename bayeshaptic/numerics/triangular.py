"""Least squares from a triangle: what a QR leaves to solve, of many systems at once."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Complexes

# Diagonals below this share of the largest belong to columns that depend on the ones before them;
# the unknowns of these are zero.
_LEAST = 1e-12


def back_substituted(triangle: Complexes, target: Complexes) -> Complexes:
    """Solve R x = z, from the last unknown to the first.

    Parameters
    ----------
    triangle : complex ndarray, shape (..., k, k)
        Upper triangular.
    target : complex ndarray, shape (..., k)

    Returns
    -------
    complex ndarray, shape (..., k)
    """
    diagonal = np.diagonal(triangle, axis1=-2, axis2=-1)
    size = np.abs(diagonal)
    told = size > _LEAST * size.max(axis=-1, keepdims=True)
    inverse = np.where(told, 1 / np.where(told, diagonal, 1.0), 0.0)
    found = np.zeros_like(target)
    for row in reversed(range(target.shape[-1])):
        known = np.sum(triangle[..., row, row + 1 :] * found[..., row + 1 :], axis=-1)
        found[..., row] = (target[..., row] - known) * inverse[..., row]
    return found
