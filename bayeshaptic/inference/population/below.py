"""Draws of what lies below the hyperparameters: the device, the people, the recordings."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.inference.population.hierarchy import Hierarchy, inverse
from bayeshaptic.inference.population.hyperparameters import Hyperparameters
from bayeshaptic.numerics.truncated_normal import draw_above
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Below:
    """Joint draws of a hierarchy, n of them.

    Attributes
    ----------
    level : Hyperparameters
    beta : ndarray, shape (n, q)
        Mean hand, then the device in each configuration; in the coordinates of the study, with the
        prior's mean added.
    recordings : ndarray, shape (n, R, D)
        Coordinates of every recording.
    """

    level: Hyperparameters
    beta: Floats = field(repr=False)
    recordings: Floats = field(repr=False)


def draw_below(hierarchy: Hierarchy, phi: Floats, walls: Floats, rng: np.random.Generator) -> Below:
    """One draw below each vector phi of shape (n, Q).

    Parameters
    ----------
    hierarchy : Hierarchy
    phi : ndarray, shape (n, Q)
    walls : ndarray, shape (D,)
        Lowest value of each coordinate of the mean; -inf where there is none.
    rng : numpy.random.Generator
    """
    chunk = 256
    parts = [
        _draw(hierarchy, phi[start : start + chunk], walls, rng)
        for start in range(0, len(phi), chunk)
    ]
    beta, recordings = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Below(hierarchy.layout.read(phi), beta, recordings)


def _draw(
    hierarchy: Hierarchy, phi: Floats, walls: Floats, rng: np.random.Generator
) -> tuple[Floats, Floats]:
    given = hierarchy.given(phi)
    order = np.concatenate([hierarchy.hand, *[hierarchy.device] * (int(hierarchy.place.max()) + 1)])
    low = (walls - hierarchy.prior_mean)[order]
    beta = draw_above(low, given.beta, inverse(given.precision), rng)
    people = given.draw_people(beta, rng)
    x = np.einsum("rip,bp->bri", hierarchy.design, beta)
    x[:, :, hierarchy.hand] += people[:, hierarchy.user]
    # Around that, by conditioning a draw of prior and noise on what was seen (Matheron's rule).
    sd = np.sqrt(given.spread)[:, None, :]
    guess = x + sd * rng.standard_normal(x.shape)
    roots = np.linalg.cholesky(hierarchy.covariance)
    noise = np.einsum("rij,brj->bri", roots, rng.standard_normal(x.shape))
    off = np.einsum("brij,brj->bri", given.weight, hierarchy.mean - guess - noise)
    x = guess + given.spread[:, None, :] * off
    return beta + hierarchy.prior_mean[order], x + hierarchy.prior_mean
