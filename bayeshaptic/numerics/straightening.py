"""Straightening a curved posterior: coordinates in which its ridges are lines.

Along a ridge that the data hardly decide (the hand's mass against its spring, say) the other
parameters follow along a curve, often a hundred times longer than it is thick.  In principal
components v, the wide ones first, each component is freed from a polynomial of the second degree in
those before it,

    y_k = v_k - q_k(v_1 .. v_{k-1}),

which keeps volumes as they are, so that densities carry over without a Jacobian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bayeshaptic.types import Floats, Ints


@dataclass(frozen=True)
class Straightening:
    """A map between points x and straight coordinates y, both of shape (B, P).

    Attributes
    ----------
    mean : ndarray, shape (P,)
    whiten, colour : ndarray, shape (P, P)
        v = (x - mean) @ whiten, and back.
    constant : ndarray, shape (P,)
    linear : ndarray, shape (P, P)
    quadratic : ndarray, shape (P, P, P)
        q_k = constant_k + linear_k v + v quadratic_k v; only entries below k differ from zero.
    """

    mean: Floats
    whiten: Floats
    colour: Floats
    constant: Floats
    linear: Floats
    quadratic: Floats

    def straight(self, x: Floats) -> Floats:
        """Straight coordinates of `x`."""
        v = (x - self.mean) @ self.whiten
        y = v - self.constant
        for k in self._curved:
            y[:, k] -= self._follows(k, v)
        return y

    def bent(self, y: Floats) -> Floats:
        """The points whose straight coordinates are `y`."""
        v = y + self.constant
        with np.errstate(over="ignore", invalid="ignore"):  # far out there is nothing to find
            for k in self._curved:
                v[:, k] += self._follows(k, v)
            return v @ self.colour + self.mean

    @cached_property
    def _curved(self) -> tuple[int, ...]:
        """Which components follow others: few, where a posterior is next to normal."""
        return tuple(np.flatnonzero(self.linear.any(axis=1) | self.quadratic.any(axis=(1, 2))))

    def _follows(self, k: int, v: Floats) -> Floats:
        """q_k without its constant, shape (B,)."""
        below = v[:, :k]
        return np.einsum("bi,bi->b", below @ self.quadratic[k, :k, :k] + self.linear[k, :k], below)


def nothing_to_straighten(size: int) -> Straightening:
    """The identity for `size` parameters."""
    eye = np.eye(size)
    none = np.zeros((size, size, size))
    return Straightening(np.zeros(size), eye, eye, none[0, 0], none[0], none)


def straighten(x: Floats, together: int = 1) -> Straightening:
    """Fit the map to draws, by regression.

    Parameters
    ----------
    x : ndarray, shape (B, P)
    together : int
        So many draws, one after the other, are of one walker and may be alike.
    """
    mean = x.mean(axis=0)
    # A parameter that is the same in all draws has the rounding of its mean for a spread.
    sd = np.maximum(x.std(axis=0), 1e-12 * np.abs(mean) + 1e-300)
    values, vectors = np.linalg.eigh(np.cov(((x - mean) / sd).T))
    order = np.argsort(-values)
    width = np.sqrt(np.maximum(values[order], 1e-12 * values.max()))
    whiten = vectors[:, order] / sd[:, None] / width
    colour = (vectors[:, order] * width).T * sd
    v = (x - mean) @ whiten
    size = x.shape[1]
    constant, linear = np.zeros(size), np.zeros((size, size))
    quadratic = np.zeros((size, size, size))
    first, second = np.triu_indices(size - 1)
    products = v[:, first] * v[:, second]
    strength = _strength(products, v, together)
    ridge = 1e-3
    for k in range(1, size):
        chosen = _chosen(np.where(second < k, strength[:, k], 0.0), len(x))
        if not len(chosen):
            continue
        # Principal components are uncorrelated, but not with each other's squares where skewed.
        terms = np.column_stack([np.ones(len(v)), v[:, :k], products[:, chosen]])
        normal = terms.T @ terms + ridge * len(v) * np.eye(terms.shape[1])
        found = np.linalg.solve(normal, terms.T @ v[:, k])
        constant[k], linear[k, :k] = found[0], found[1 : k + 1]
        quadratic[k, first[chosen], second[chosen]] = found[k + 1 :]
    return Straightening(mean, whiten, colour, constant, linear, quadratic)


def _strength(products: Floats, v: Floats, together: int) -> Floats:
    """How far the slope of each component over each product is from zero, in standard errors.

    Those of walkers, not of draws: one that stays somewhere for long says one thing many times.
    """
    off = products - products.mean(axis=0)
    found = np.empty((products.shape[1], v.shape[1]))
    for k in range(v.shape[1]):
        own = (off * v[:, [k]]).reshape(-1, together, products.shape[1]).sum(axis=1)
        found[:, k] = np.abs(own.sum(axis=0)) / np.sqrt(np.maximum(np.sum(own**2, axis=0), 1e-300))
    return found


def _chosen(strength: Floats, points: int) -> Ints:
    """Which products are seen, the clearest ones if the points cannot decide that many.

    What is not seen would bend a straight ridge by the accidents of the draws: of eleven parameters
    there are some two hundred products.
    """
    seen = 5.0  # standard errors
    points_a_term = 30  # fewer points than that cannot decide a coefficient
    clearest = np.argsort(-strength, kind="stable")[: points // points_a_term]
    return np.sort(clearest[strength[clearest] > seen])
