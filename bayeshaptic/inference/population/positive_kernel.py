"""Many small positive definite matrices: what is asked of each, from one Cholesky factor."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats


@kernel
def inverses(matrices: Floats) -> tuple[Floats, Floats]:
    """Inverses, and logarithms of the determinants.

    Parameters
    ----------
    matrices : ndarray, shape (N, n, n)
        Only the lower triangles are read.

    Returns
    -------
    inverse : ndarray, shape (N, n, n)
    log_det : ndarray, shape (N,)
        nan where a matrix is not positive definite.
    """
    count, n = matrices.shape[0], matrices.shape[1]
    inverse, log_det = np.empty((count, n, n)), np.empty(count)
    root, back = np.empty((n, n)), np.empty((n, n))
    for b in range(count):
        total = 0.0
        for j in range(n):
            square = matrices[b, j, j]
            for k in range(j):
                square -= root[j, k] * root[j, k]
            root[j, j] = np.sqrt(square)
            total += np.log(root[j, j])
            for i in range(j + 1, n):
                value = matrices[b, i, j]
                for k in range(j):
                    value -= root[i, k] * root[j, k]
                root[i, j] = value / root[j, j]
        for j in range(n):  # the inverse of the factor
            back[j, j] = 1.0 / root[j, j]
            for i in range(j + 1, n):
                value = 0.0
                for k in range(j, i):
                    value -= root[i, k] * back[k, j]
                back[i, j] = value / root[i, i]
        for i in range(n):
            for j in range(i + 1):
                value = 0.0
                for k in range(i, n):
                    value += back[k, i] * back[k, j]
                inverse[b, i, j] = inverse[b, j, i] = value
        log_det[b] = 2.0 * total
    return inverse, log_det
