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
    """A mixture of Student t distributions.

    Attributes
    ----------
    weights : ndarray, shape (C,)
    means : ndarray, shape (C, P)
    roots : ndarray, shape (C, P, P)
        Lower Cholesky factors of the scale matrices.
    freedom : ndarray, shape (C,)
        Degrees of freedom of each: one that is wide for safety does not make the others so.
    """

    weights: Floats
    means: Floats
    roots: Floats
    freedom: Floats

    def sample(self, rng: np.random.Generator, count: int) -> Floats:
        """`count` draws, shape (count, P)."""
        component = rng.choice(len(self.weights), size=count, p=self.weights)
        normal = rng.standard_normal((count, self.means.shape[1]))
        freedom = self.freedom[component]
        normal /= np.sqrt(rng.chisquare(freedom) / freedom)[:, None]
        return self.means[component] + np.einsum("bpq,bq->bp", self.roots[component], normal)

    @cached_property
    def whitening(self) -> Floats:
        """Inverses of the roots, shape (C, P, P)."""
        eye = np.eye(self.means.shape[1])
        return np.stack([solve_triangular(root, eye, lower=True) for root in self.roots])

    def component_log_densities(self, x: Floats) -> Floats:
        """Weighted log density of every component, shape (C, B)."""
        white = (x - self.means[:, None, :]) @ self.whitening.transpose(0, 2, 1)
        return self.log_densities_at(np.einsum("cbp,cbp->cb", white, white))

    def log_densities_at(self, distances: Floats) -> Floats:
        """The same at squared Mahalanobis distances from every component, shape (C, B)."""
        nu, size = self.freedom[:, None], self.means.shape[1]
        return self._at_peak[:, None] - 0.5 * (nu + size) * np.log1p(distances / nu)

    @cached_property
    def _at_peak(self) -> Floats:
        """Weighted log density of every component at its mean, shape (C,)."""
        nu, size = self.freedom, self.means.shape[1]
        norm = gammaln(0.5 * (nu + size)) - gammaln(0.5 * nu) - 0.5 * size * np.log(nu * np.pi)
        half_log_det = np.log(np.einsum("cpp->cp", self.roots)).sum(axis=1)
        return np.asarray(np.log(self.weights) + norm - half_log_det)

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
            np.concatenate([self.freedom, other.freedom]),
        )


def student(mean: Floats, covariance: Floats, freedom: float = 8.0) -> StudentMixture:
    """One Student t distribution with the given mean, (D,), and scale matrix, (D, D)."""
    root = root_of(covariance)
    return StudentMixture(np.ones(1), mean[None], root[None], np.array([freedom]))


def root_of(covariance: Floats) -> Floats:
    """Cholesky factor, (D, D); directions that the points do not span get a little width."""
    covariance = 0.5 * (covariance + covariance.T)
    no_width = 1e-24  # variance, of coordinates of order one, that rounding errors have
    scale = np.sqrt(np.maximum(np.diag(covariance), no_width))
    correlation = covariance / np.outer(scale, scale)
    np.fill_diagonal(correlation, 1.0)  # where all points are one, there is none
    values, vectors = np.linalg.eigh(correlation)
    values = np.maximum(values, 1e-10 * values[-1])
    mended = (vectors * values) @ vectors.T
    return scale[:, None] * np.linalg.cholesky(mended)
