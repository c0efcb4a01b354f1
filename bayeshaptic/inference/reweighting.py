"""Every recording's parameters given the population, weighted by its exact likelihood."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.below import Below
from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.gaussian_likelihood import exact_likelihood
from bayeshaptic.inference.hierarchy import Hierarchy
from bayeshaptic.inference.pareto import pareto_k
from bayeshaptic.inference.posterior import Posterior

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reweighted:
    """One recording's parameters given all recordings of the study.

    Attributes
    ----------
    user : str
    draws : ndarray, shape (n, P)
        Natural values, equally weighted.
    effective : float
        Kish's effective number of the weighted draws that these were chosen from.
    pareto_k : float
        Shape of the tail of the weights: above 0.7 they are not to be trusted; nan where the
        measurement is not there to weigh with.
    """

    user: str
    draws: Floats = field(repr=False)
    effective: float
    pareto_k: float


def reweight(
    posteriors: Sequence[Posterior],
    users: Sequence[str],
    hierarchy: Hierarchy,
    below: Below,
    here: Coordinates,
    rng: np.random.Generator,
) -> tuple[Reweighted, ...]:
    """Draws of every recording, resampled by exact over described likelihood."""
    out = []
    low = np.where(here.log, -np.inf, here.low)
    for r, (posterior, likelihood) in enumerate(
        zip(posteriors, hierarchy.likelihoods, strict=True)
    ):
        x = below.recordings[:, r]
        x = x[np.all(x >= low, axis=1)]
        exact = exact_likelihood(posterior, here, x)
        log_weight = np.zeros(len(x)) if exact is None else exact - likelihood(x)
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        chosen = _resampled(weight, rng)
        k = float("nan") if exact is None else pareto_k(log_weight)
        effective = float(1 / np.sum(weight**2))
        out.append(Reweighted(users[r], here.natural(x[chosen]), effective, k))
    return tuple(out)


def _resampled(weight: Floats, rng: np.random.Generator) -> NDArray[np.int_]:
    """As many indices as weights, each as often as its weight says (systematic resampling)."""
    count = len(weight)
    steps = (np.arange(count) + rng.uniform()) / count
    chosen = np.minimum(np.searchsorted(np.cumsum(weight), steps), count - 1)
    return rng.permutation(chosen)


def inside(x: Floats, here: Coordinates) -> Floats:
    """Mirrored at the walls, so that no damper is negative."""
    low = np.where(here.log, -np.inf, here.low)
    with np.errstate(invalid="ignore"):
        return np.where(x < low, 2 * low - x, x)
