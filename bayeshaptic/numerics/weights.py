"""Importance weights from their logarithms."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Floats, Ints


def normalised(log_weights: Floats) -> Floats:
    """Weights that sum to one, shape (n,); all alike where none is possible."""
    top = log_weights.max()
    if not np.isfinite(top):
        return np.full(len(log_weights), 1 / len(log_weights))
    weights = np.exp(log_weights - top)
    return np.asarray(weights / weights.sum())


def effective(weights: Floats) -> float:
    """Kish's effective number of points of weights (N,)."""
    return float(weights.sum() ** 2 / max(np.sum(weights**2), 1e-300))


def tempered(log_weights: Floats, least: float) -> Floats:
    """Weights (N,), flattened until `least` points count: what fits five points means nothing.

    In logarithms, because one point may outweigh the others by more than a number can hold.
    """
    for power in 0.7 ** np.arange(60):
        weights = normalised(power * log_weights)
        if effective(weights) >= least:
            break
    return weights


def truncated(log_weights: Floats) -> Floats:
    """Logarithms of weights of which none is larger than the mean times the root of their number.

    E. L. Ionides, "Truncated importance sampling", Journal of Computational and Graphical
    Statistics 17, 2008: no single point decides.
    """
    top = log_weights.max()
    if not np.isfinite(top):
        return log_weights
    mean = np.log(np.mean(np.exp(log_weights - top))) + top
    return np.asarray(np.minimum(log_weights, mean + 0.5 * np.log(len(log_weights))))


def systematic(weight: Floats, count: int, rng: np.random.Generator) -> Ints:
    """Indices, shape (count,), each as often as its weight says, in ascending order."""
    edges = np.cumsum(weight / weight.sum())
    edges[-1] = 1.0
    return np.searchsorted(edges, (np.arange(count) + rng.uniform()) / count)
