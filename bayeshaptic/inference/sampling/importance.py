"""Adapting the proposal by importance sampling, before any chain runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.numerics.mixture import StudentMixture, fit_student_mixture
from bayeshaptic.types import Floats

_DRAWS = 2000
_GOOD = 0.5  # efficiency at which the proposal is left as it is
_COMPONENTS = 3
_POWERS = 0.7 ** np.arange(60)  # of weights that a few points would have for themselves


@dataclass(frozen=True)
class Adapted:
    """A proposal with points from it.

    Attributes
    ----------
    proposal : StudentMixture
    points : ndarray, shape (B, P)
    weights : ndarray, shape (B,)
        Importance weights, summing to one.
    efficiency : float
        Kish's effective sample size over the number of points of the last round.
    """

    proposal: StudentMixture
    points: Floats
    weights: Floats
    efficiency: float


def adapt(
    density: Callable[[Floats], Floats],
    first: StudentMixture,
    rng: np.random.Generator,
    rounds: int = 4,
) -> Adapted:
    """Importance sampling from `first`, then from mixtures fitted to what was found.

    All points are pooled with deterministic-mixture weights: each is weighed against the average
    of all proposals so far, so that one early outlier cannot dominate.

    Parameters
    ----------
    density : callable
        Log density of points of shape (B, P).
    first : StudentMixture
    rng : numpy.random.Generator
    rounds : int
        At most so many.
    """
    proposals = [first]
    points = first.sample(rng, _DRAWS)
    target = density(points)
    while True:
        average = np.mean(np.exp(_shifted([p.log_density(points) for p in proposals])), axis=0)
        base = np.max([p.log_density(points) for p in proposals], axis=0)
        log_weights = target - base - np.log(average)
        weights = _normalised(log_weights)
        newest = weights[-_DRAWS:]
        efficiency = float(newest.sum() ** 2 / max(np.sum(newest**2), 1e-300) / _DRAWS)
        if efficiency > _GOOD or len(proposals) > rounds:
            return Adapted(proposals[-1], points, weights, efficiency)
        flat = _tempered(log_weights, 5 * points.shape[1])
        fitted = fit_student_mixture(points, flat, _COMPONENTS, 8.0, rng)
        proposals.append(fitted.with_component(first, 0.1))
        drawn = proposals[-1].sample(rng, _DRAWS)
        points = np.concatenate([points, drawn])
        target = np.concatenate([target, density(drawn)])


def _shifted(logs: list[Floats]) -> Floats:
    stacked = np.stack(logs)
    return stacked - stacked.max(axis=0)


def _normalised(log_weights: Floats) -> Floats:
    top = log_weights.max()
    if not np.isfinite(top):
        return np.full(len(log_weights), 1 / len(log_weights))
    weights = np.exp(log_weights - top)
    return weights / weights.sum()


def _tempered(log_weights: Floats, fewest: int, least: float = 100.0) -> Floats:
    """Flatten weights until at least `least` points count: a fit to five points means nothing.

    In logarithms, because one point may outweigh the others by more than a number can hold.  Where
    not even `fewest` points lie in the support, all count alike: the proposal stays as it is.
    """
    possible = np.isfinite(log_weights)
    if possible.sum() < fewest:
        return np.full(len(log_weights), 1 / len(log_weights))
    least = min(least, 0.9 * float(possible.sum()))
    for power in _POWERS:
        flat = _normalised(power * log_weights)
        if 1 / np.sum(flat**2) >= least:
            break
    return flat
