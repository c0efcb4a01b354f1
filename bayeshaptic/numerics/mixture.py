"""Mixtures of multivariate Student t distributions: the proposal of the sampler."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import gammaln

from bayeshaptic.types import Floats


@dataclass(frozen=True)
class StudentMixture:
    """A mixture of Student t distributions with common degrees of freedom.

    Attributes
    ----------
    weights : ndarray, shape (C,)
    means : ndarray, shape (C, P)
    roots : ndarray, shape (C, P, P)
        Lower Cholesky factors of the scale matrices.
    freedom : float
        Degrees of freedom.
    """

    weights: Floats
    means: Floats
    roots: Floats
    freedom: float

    def sample(self, rng: np.random.Generator, count: int) -> Floats:
        """`count` draws, shape (count, P)."""
        component = rng.choice(len(self.weights), size=count, p=self.weights)
        normal = rng.standard_normal((count, self.means.shape[1]))
        normal /= np.sqrt(rng.chisquare(self.freedom, count) / self.freedom)[:, None]
        return self.means[component] + np.einsum("bpq,bq->bp", self.roots[component], normal)

    @cached_property
    def _whitening(self) -> Floats:
        """Inverses of the roots, shape (C, P, P)."""
        eye = np.eye(self.means.shape[1])
        return np.stack([solve_triangular(root, eye, lower=True) for root in self.roots])

    def distances(self, x: Floats) -> Floats:
        """Squared Mahalanobis distances to every component, shape (C, B)."""
        white = (x - self.means[:, None, :]) @ self._whitening.transpose(0, 2, 1)
        return np.einsum("cbp,cbp->cb", white, white)

    def component_log_densities(self, x: Floats) -> Floats:
        """Weighted log density of every component, shape (C, B)."""
        return self._log_densities(self.distances(x))

    def _log_densities(self, distances: Floats) -> Floats:
        nu, size = self.freedom, self.means.shape[1]
        norm = gammaln(0.5 * (nu + size)) - gammaln(0.5 * nu) - 0.5 * size * np.log(nu * np.pi)
        half_log_det = np.log(np.einsum("cpp->cp", self.roots)).sum(axis=1)
        kernel = -0.5 * (nu + size) * np.log1p(distances / nu)
        return kernel + (np.log(self.weights) + norm - half_log_det)[:, None]

    def log_density(self, x: Floats) -> Floats:
        """Log density of points of shape (B, P); shape (B,)."""
        parts = self.component_log_densities(x)
        # As scipy's logsumexp, which spends more on what kind of array it has than on these.
        largest = np.maximum(parts.max(axis=0), np.finfo(float).min)
        with np.errstate(divide="ignore"):  # endlessly far away
            return np.asarray(largest + np.log(np.exp(parts - largest).sum(axis=0)))

    def with_component(self, other: StudentMixture, share: float) -> StudentMixture:
        """This mixture with `share` of `other` mixed in (for safety in the tails)."""
        return StudentMixture(
            np.concatenate([(1 - share) * self.weights, share * other.weights]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.roots, other.roots]),
            min(self.freedom, other.freedom),
        )


def student(mean: Floats, covariance: Floats, freedom: float = 8.0) -> StudentMixture:
    """One Student t distribution with the given mean and scale matrix."""
    return StudentMixture(np.ones(1), mean[None], _root(covariance)[None], freedom)


def fit_student_mixture(
    x: Floats,
    weights: Floats,
    components: int,
    freedom: float,
    rng: np.random.Generator,
    rounds: int = 25,
) -> StudentMixture:
    """Fit a mixture to weighted points by expectation-maximisation.

    D. Peel and G. J. McLachlan, "Robust mixture modelling using the t distribution", Statistics
    and Computing 10 (2000), with the degrees of freedom held.

    Parameters
    ----------
    x : ndarray, shape (B, P)
    weights : ndarray, shape (B,)
        They need not sum to one.
    components : int
    freedom : float
    rng : numpy.random.Generator
        For the starting points.
    rounds : int
    """
    w = weights / weights.sum()
    size = x.shape[1]
    overall = student(w @ x, _covariance(x, w, w @ x), freedom)
    if components == 1:
        return overall
    centres = x[rng.choice(len(x), size=components, p=w)]
    mixture = StudentMixture(
        np.full(components, 1 / components),
        centres,
        np.repeat(overall.roots, components, axis=0),
        freedom,
    )
    ridge = 1e-3 * overall.roots[0] @ overall.roots[0].T  # in the shape of the whole
    for _ in range(rounds):
        distances = mixture.distances(x)
        logs = mixture._log_densities(distances)
        share = np.exp(logs - logs.max(axis=0))
        share *= w / share.sum(axis=0)
        pull = share * (freedom + size) / (freedom + distances)
        total = share.sum(axis=1)
        if np.any(total < (size + 2) / len(x)):  # a component that starves would collapse
            return overall
        means = (pull @ x) / pull.sum(axis=1)[:, None]
        roots = []
        for c in range(components):
            off = x - means[c]
            scatter = (off * pull[c][:, None]).T @ off / total[c]
            roots.append(_root(scatter + ridge))
        mixture = StudentMixture(total / total.sum(), means, np.stack(roots), freedom)
    return mixture


def _covariance(x: Floats, w: Floats, mean: Floats) -> Floats:
    off = x - mean
    return (off * w[:, None]).T @ off


def _root(covariance: Floats) -> Floats:
    """Cholesky factor; directions that the points do not span get a little width of their own."""
    covariance = 0.5 * (covariance + covariance.T)
    no_width = 1e-24  # variance, of coordinates of order one, that rounding errors have
    scale = np.sqrt(np.maximum(np.diag(covariance), no_width))
    correlation = covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)  # where all points are one, there is none
    values, vectors = np.linalg.eigh(correlation)
    values = np.maximum(values, 1e-10 * values[-1])
    mended = (vectors * values) @ vectors.T
    return scale[:, None] * np.linalg.cholesky(mended)
