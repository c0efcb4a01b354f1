"""Many small positive definite matrices: what is asked of each, from one Cholesky factor.

Eight of them go together: of one alone each sum waits for the one before.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats, Ints

LANES = 8  # matrices at a time: the last axis of all that stands for several


@kernel(inline=True)
def _invert(matrix: Floats, root: Floats, back: Floats, inverse: Floats, log_det: Floats) -> None:
    """Write the inverses of matrices (n, n, LANES), and add logarithms of their determinants.

    `root` and `back` are room for the Cholesky factors, and for the inverses of these.
    """
    n = matrix.shape[0]
    for j in range(n):
        diagonal = root[j, j]
        for x in range(LANES):
            diagonal[x] = matrix[j, j, x]
        for k in range(j):
            for x in range(LANES):
                diagonal[x] -= root[j, k, x] * root[j, k, x]
        for x in range(LANES):
            diagonal[x] = np.sqrt(diagonal[x])
            log_det[x] += 2.0 * np.log(diagonal[x])
        for i in range(j + 1, n):
            value = root[i, j]
            for x in range(LANES):
                value[x] = matrix[i, j, x]
            for k in range(j):
                for x in range(LANES):
                    value[x] -= root[i, k, x] * root[j, k, x]
            for x in range(LANES):
                value[x] /= diagonal[x]
    for j in range(n):
        for x in range(LANES):
            back[j, j, x] = 1.0 / root[j, j, x]
        for i in range(j + 1, n):
            value = back[i, j]
            for x in range(LANES):
                value[x] = 0.0
            for k in range(j, i):
                for x in range(LANES):
                    value[x] -= root[i, k, x] * back[k, j, x]
            for x in range(LANES):
                value[x] /= root[i, i, x]
    for i in range(n):
        for j in range(i + 1):
            value = inverse[i, j]
            for x in range(LANES):
                value[x] = 0.0
            for k in range(i, n):
                for x in range(LANES):
                    value[x] += back[k, i, x] * back[k, j, x]
            for x in range(LANES):
                inverse[j, i, x] = value[x]


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
    matrix, found = np.empty((n, n, LANES)), np.empty((n, n, LANES))
    root, back = np.empty((n, n, LANES)), np.empty((n, n, LANES))
    logs = np.empty(LANES)
    for first in range(0, count, LANES):
        for x in range(LANES):
            logs[x] = 0.0
            matrix[:, :, x] = matrices[min(first + x, count - 1)]
        _invert(matrix, root, back, found, logs)
        for x in range(min(LANES, count - first)):
            inverse[first + x] = found[:, :, x]
            log_det[first + x] = logs[x]
    return inverse, log_det


@kernel
def summed(
    covariance: Floats,
    mean: Floats,
    spread: Floats,
    entry: Ints,
    user: Ints,
    hand: Ints,
    people: int,
    size: int,
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
    """What R recordings say, summed over all of them and over those of each of U users.

    W is the inverse of a recording's covariance with a spread on its diagonal.

    Parameters
    ----------
    covariance : ndarray, shape (R, D, D)
    mean : ndarray, shape (R, D)
    spread : ndarray, shape (B, D, LANES)
    entry : ndarray of int, shape (R, D)
        Which entry of beta each coordinate is.
    user : ndarray of int, shape (R,)
    hand : ndarray of int, shape (H,)
        Which coordinates are the hand's.
    people, size : int
        U, and the number q of entries of beta.

    Returns
    -------
    precision, score : ndarray, shape (B, q, q, LANES), (B, q, LANES)
        Of beta: W, and W times the mean.
    chi, log_det : ndarray, shape (B, LANES)
        Squares of the means by W, and log determinants of the inverses of W: nan where one is not
        positive definite.
    own, own_score, own_seen : ndarray, shape (B, U, H, H, LANES), (B, U, H, LANES), \
(B, U, H, q, LANES)
        W among the hand, times the mean, and its rows over beta; of each user.
    """
    count, n, fingers = len(spread), mean.shape[1], len(hand)
    precision, score = np.zeros((count, size, size, LANES)), np.zeros((count, size, LANES))
    chi, log_det = np.zeros((count, LANES)), np.zeros((count, LANES))
    own = np.zeros((count, people, fingers, fingers, LANES))
    own_score = np.zeros((count, people, fingers, LANES))
    own_seen = np.zeros((count, people, fingers, size, LANES))
    matrix, weight = np.empty((n, n, LANES)), np.empty((n, n, LANES))
    root, back = np.empty((n, n, LANES)), np.empty((n, n, LANES))
    pull = np.empty((n, LANES))
    for b in range(count):
        for r in range(len(mean)):
            for i in range(n):
                for j in range(i + 1):
                    for x in range(LANES):
                        matrix[i, j, x] = covariance[r, i, j]
                for x in range(LANES):
                    matrix[i, i, x] += spread[b, i, x]
            _invert(matrix, root, back, weight, log_det[b])
            for i in range(n):
                row = entry[r, i]
                for x in range(LANES):
                    pull[i, x] = 0.0
                for j in range(n):
                    for x in range(LANES):
                        pull[i, x] += weight[i, j, x] * mean[r, j]
                        precision[b, row, entry[r, j], x] += weight[i, j, x]
                for x in range(LANES):
                    score[b, row, x] += pull[i, x]
                    chi[b, x] += pull[i, x] * mean[r, i]
            u = user[r]
            for i in range(fingers):
                row = hand[i]
                for x in range(LANES):
                    own_score[b, u, i, x] += pull[row, x]
                for j in range(fingers):
                    for x in range(LANES):
                        own[b, u, i, j, x] += weight[row, hand[j], x]
                for j in range(n):
                    for x in range(LANES):
                        own_seen[b, u, i, entry[r, j], x] += weight[row, j, x]
    return precision, score, chi, log_det, own, own_score, own_seen


@kernel
def log_mixture(x: Floats, whitening: Floats, middle: Floats, scale: Floats) -> Floats:
    """Log of the mean density of K normal distributions at points of shape (B, D), (B,).

    Parameters
    ----------
    x : ndarray, shape (B, D)
    whitening : ndarray, shape (D, D, K)
        Inverses of the Cholesky factors of the covariances; only the lower triangles are read.
    middle : ndarray, shape (D, K)
        The means, times these.
    scale : ndarray, shape (K,)
        Log determinants of these.
    """
    count, size, parts = len(x), x.shape[1], len(scale)
    out, logs, white = np.empty(count), np.empty(parts), np.empty(parts)
    for b in range(count):
        for k in range(parts):
            logs[k] = scale[k]
        for i in range(size):
            for k in range(parts):
                white[k] = -middle[i, k]
            for j in range(i + 1):
                for k in range(parts):
                    white[k] += whitening[i, j, k] * x[b, j]
            for k in range(parts):
                logs[k] -= 0.5 * white[k] * white[k]
        top = logs.max()
        total = 0.0
        for k in range(parts):
            total += np.exp(logs[k] - top)
        out[b] = top + np.log(total) - np.log(parts)
    return out
