"""The priors of all parameters of a model at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.models.prior import ByTerms, Prior
from bayeshaptic.types import Bools, Floats, Ints


@dataclass(frozen=True)
class JointPrior:
    """Independent priors, evaluated together where they are sums of `Terms`.

    Attributes
    ----------
    columns : ndarray of int
        Parameters of the parts: of those that have that form the first part each, then all further
        ones.
    terms : ndarray, shape (7, len(columns))
        The fields of `Terms` that are numbers.
    logarithmic : ndarray of bool, shape (len(columns),)
    further : tuple of int
        To which of the first parts each of the further ones is added.
    alone : tuple of (int, Prior)
        The other parameters, and their priors.
    """

    columns: Ints
    terms: Floats
    logarithmic: Bools
    further: tuple[int, ...]
    alone: tuple[tuple[int, Prior], ...]

    def __call__(self, theta: Floats) -> Floats:
        """Log density of parameter vectors of shape (B, P); shape (B,)."""
        low, high, shift, centre, inverse_sd, weight, constant = self.terms
        x = theta[:, self.columns]
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            log = np.log(x + shift)
            u = (np.where(self.logarithmic, log, x) - centre) * inverse_sd
            density = constant - 0.5 * u * u - np.where(weight > 0, weight * log, 0.0)
        density = np.where((x >= low) & (x <= high), density, -np.inf)
        firsts = density.shape[1] - len(self.further)
        for place, part in enumerate(self.further, firsts):
            density[:, part] = np.logaddexp(density[:, part], density[:, place])
        total: Floats = density[:, :firsts].sum(axis=1)
        for column, prior in self.alone:
            total += prior.log_density(theta[:, column])
        return total


def joint_prior(priors: Sequence[Prior]) -> JointPrior:
    """The product of `priors`, a parameter each."""
    together = [i for i, prior in enumerate(priors) if isinstance(prior, ByTerms)]
    parts = [prior.parts for prior in priors if isinstance(prior, ByTerms)]
    further = [(place, part) for place, own in enumerate(parts) for part in own[1:]]
    terms = [own[0] for own in parts] + [part for _, part in further]
    numbers = ((t.low, t.high, t.shift, t.centre, 1 / t.sd, t.over_x, t.constant) for t in terms)
    return JointPrior(
        np.array(together + [together[place] for place, _ in further], int),
        np.array(list(numbers)).reshape(-1, 7).T,
        np.array([term.logarithmic for term in terms], bool),
        tuple(place for place, _ in further),
        tuple((i, prior) for i, prior in enumerate(priors) if i not in together),
    )
