"""The priors of all parameters of a model at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.models.prior import Prior
from bayeshaptic.types import Bools, Floats, Ints


@dataclass(frozen=True)
class JointPrior:
    """Independent priors, evaluated together where they have the form of `Terms`.

    Attributes
    ----------
    together, alone : ndarray of int
        Columns of the parameters that have that form, and of the others.
    terms : ndarray, shape (7, len(together))
        The fields of `Terms` that are numbers.
    logarithmic : ndarray of bool, shape (len(together),)
    others : tuple of Prior
    """

    together: Ints
    alone: Ints
    terms: Floats
    logarithmic: Bools
    others: tuple[Prior, ...]

    def __call__(self, theta: Floats) -> Floats:
        """Log density of parameter vectors of shape (B, P); shape (B,)."""
        low, high, shift, centre, inverse_sd, weight, constant = self.terms
        x = theta[:, self.together] if len(self.alone) else theta
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            log = np.log(x + shift)
            u = (np.where(self.logarithmic, log, x) - centre) * inverse_sd
            density = constant - 0.5 * u * u - np.where(weight > 0, weight * log, 0.0)
        total: Floats = np.where((x >= low) & (x <= high), density, -np.inf).sum(axis=1)
        for column, prior in zip(self.alone, self.others, strict=True):
            total += prior.log_density(theta[:, column])
        return total


def joint_prior(priors: Sequence[Prior]) -> JointPrior:
    """The product of `priors`, a parameter each."""
    terms = [getattr(prior, "terms", None) for prior in priors]
    known = [term for term in terms if term is not None]
    numbers = ((t.low, t.high, t.shift, t.centre, 1 / t.sd, t.over_x, t.constant) for t in known)
    return JointPrior(
        np.flatnonzero([term is not None for term in terms]),
        np.flatnonzero([term is None for term in terms]),
        np.array(list(numbers)).reshape(-1, 7).T,
        np.array([term.logarithmic for term in known], bool),
        tuple(prior for prior, term in zip(priors, terms, strict=True) if term is None),
    )
