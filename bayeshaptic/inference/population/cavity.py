"""What the rest of a study says of one recording's parameters, and both together, exactly.

In the words of expectation propagation (A. Gelman et al., "Expectation propagation as a way of
life", Journal of Machine Learning Research 21, 2020): the cavity is the distribution of a
recording's parameters given all other recordings, the tilted distribution is the cavity times the
recording's exact likelihood.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference.population.hierarchy import Hierarchy
from bayeshaptic.numerics.weights import systematic, tempered
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Cavity:
    """A mixture of normal distributions of one recording's coordinates, equally weighted.

    Attributes
    ----------
    means : ndarray, shape (K, D)
    whitening : ndarray, shape (K, D, D)
        Inverses of the Cholesky factors of the covariances.
    """

    means: Floats = field(repr=False)
    whitening: Floats = field(repr=False)

    def __call__(self, x: Floats) -> Floats:
        """Log density of points of shape (B, D); shape (B,)."""
        from bayeshaptic.inference.population.positive_kernel import log_mixture

        scale = np.log(np.diagonal(self.whitening, axis1=1, axis2=2)).sum(axis=1)
        middle = (self.whitening @ self.means[:, :, None])[..., 0]
        inner = np.ascontiguousarray(self.whitening.transpose(1, 2, 0))
        return log_mixture(np.ascontiguousarray(x), inner, np.ascontiguousarray(middle.T), scale)


def cavity(hierarchy: Hierarchy, r: int, phi: Floats, rng: np.random.Generator) -> Cavity:
    """The cavity of recording `r`: what all other recordings say of its coordinates.

    Given hyperparameters the cavity is normal, so that over their draws it is a mixture.

    Parameters
    ----------
    hierarchy : Hierarchy
    r : int
        Index of the recording.
    phi : ndarray, shape (n, Q)
        Draws of the hyperparameters given all recordings.  Each is weighed by how little this
        recording had to do with it, which takes the recording out of them.  Of many draws 2,000
        are looked at, and 120 become components.
    rng : numpy.random.Generator

    Returns
    -------
    Cavity
    """
    own, sd = hierarchy.likelihoods[r], hierarchy.prior_sd
    looked_at = 2000
    phi = phi[:: -(-len(phi) // looked_at)]
    vague = 1e3  # prior standard deviations of a recording that says nothing
    nothing = replace(
        own,
        mean=hierarchy.prior_mean,
        precision=np.diag((vague * sd) ** -2),
        covariance=np.diag((vague * sd) ** 2),
    )
    others = list(hierarchy.likelihoods)
    others[r] = nothing
    without = replace(hierarchy, likelihoods=tuple(others))
    given = without.given(phi)
    mean, covariance = without.before(given, r)
    covariance = covariance + given.spread[:, :, None] * np.eye(len(sd))
    mean = mean + hierarchy.prior_mean
    seen = covariance + own.covariance
    off = own.mean - mean
    far = np.einsum("bi,bi->b", off, np.linalg.solve(seen, off[..., None])[..., 0])
    count = 0.2  # share of the hyperparameters that must count: a few vectors say nothing
    weight = tempered(0.5 * far + 0.5 * np.linalg.slogdet(seen)[1], count * len(phi))
    components = 120  # draws of the hyperparameters that a cavity is a mixture over
    chosen = systematic(weight, min(components, len(phi)), rng)
    return Cavity(mean[chosen], np.linalg.inv(np.linalg.cholesky(covariance[chosen])))
