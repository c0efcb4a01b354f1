"""Fitting a mixture of Student t distributions to points, by expectation-maximisation.

D. Peel and G. J. McLachlan, "Robust mixture modelling using the t distribution", Statistics and
Computing 10 (2000), with the degrees of freedom held.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import solve_triangular

from bayeshaptic.numerics.mixture import StudentMixture, student
from bayeshaptic.types import Floats

_SETTLED = 1e-3  # gain of log density a point that is none
_MOST_ROUNDS = 25  # fewer where the points gain nothing any more


def fit_student_mixture(
    x: Floats,
    weights: Floats,
    components: int,
    freedom: float,
    rng: np.random.Generator,
) -> StudentMixture:
    """Fit a mixture to weighted points.

    Parameters
    ----------
    x : ndarray, shape (B, P)
    weights : ndarray, shape (B,)
        They need not sum to one.
    components : int
    freedom : float
    rng : numpy.random.Generator
        For the starting points.
    """
    w = weights / weights.sum()
    size = x.shape[1]
    middle = w @ x
    overall = student(middle, _covariance(x, w, middle), freedom)
    if components == 1:
        return overall
    # Where the whole is standard: sums of products about zero lose nothing there.
    root = overall.roots[0]
    white = solve_triangular(root, (x - middle).T, lower=True).T
    terms = _terms(white)
    centres = white[rng.choice(len(x), size=components, p=w)]
    roots = np.repeat(np.eye(size)[None], components, axis=0)
    mixture = StudentMixture(
        np.full(components, 1 / components), centres, roots, np.full(components, freedom)
    )
    ridge = 1e-3 * np.eye(size)
    before = -np.inf
    for _ in range(_MOST_ROUNDS):
        distances = _quadratics(mixture) @ terms.T
        logs = mixture.log_densities_at(distances)
        largest = logs.max(axis=0)
        share = np.exp(logs - largest)
        whole = share.sum(axis=0)
        share *= w / whole
        pull = share * (freedom + size) / (freedom + distances)
        total = share.sum(axis=1)
        if np.any(total < (size + 2) / len(x)):  # a component that starves would collapse
            return overall
        sums = pull @ terms
        means = sums[:, 1 : size + 1] / sums[:, :1]
        spread = _square(sums[:, size + 1 :], size) - sums[:, :1, None] * _outer(means)
        roots = np.linalg.cholesky(spread / total[:, None, None] + ridge)
        mixture = StudentMixture(total / total.sum(), means, roots, mixture.freedom)
        level = float(w @ (largest + np.log(whole)))
        if level - before < _SETTLED:
            break
        before = level
    return StudentMixture(
        mixture.weights, middle + mixture.means @ root.T, root @ mixture.roots, mixture.freedom
    )


def _terms(x: Floats) -> Floats:
    """One, the coordinates and their products, shape (B, 1 + P + P (P + 1) / 2).

    Distances and moments are linear in them: a round is two products of matrices.
    """
    first, second = np.triu_indices(x.shape[1])
    return np.column_stack([np.ones(len(x)), x, x[:, first] * x[:, second]])


def _quadratics(mixture: StudentMixture) -> Floats:
    """Squared Mahalanobis distances as sums of the terms, shape (C, terms)."""
    precision = mixture.whitening.transpose(0, 2, 1) @ mixture.whitening
    pulled = np.einsum("cpq,cq->cp", precision, mixture.means)
    constant = np.einsum("cp,cp->c", pulled, mixture.means)
    first, second = np.triu_indices(mixture.means.shape[1])
    twice = np.where(first == second, 1.0, 2.0)
    products = twice * precision[:, first, second]
    return np.concatenate([constant[:, None], -2 * pulled, products], axis=1)


def _square(products: Floats, size: int) -> Floats:
    """Symmetric matrices, shape (C, P, P), of their upper triangles."""
    first, second = np.triu_indices(size)
    out = np.empty((len(products), size, size))
    out[:, first, second] = out[:, second, first] = products
    return out


def _outer(means: Floats) -> Floats:
    return np.asarray(means[:, :, None] * means[:, None, :])


def _covariance(x: Floats, w: Floats, mean: Floats) -> Floats:
    off = x - mean
    return (off * w[:, None]).T @ off
