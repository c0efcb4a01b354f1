"""Adapting the proposal by importance sampling, before any chain runs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.numerics.mixture import StudentMixture, fit_student_mixture
from bayeshaptic.numerics.weights import effective, normalised, tempered
from bayeshaptic.types import Floats

_DRAWS = 2000
_GOOD = 0.5  # efficiency at which the proposal is left as it is
_COMPONENTS = 3
_COUNTING = 100.0  # points that must count where a mixture is fitted


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
        weights = normalised(log_weights)
        efficiency = effective(weights[-_DRAWS:]) / _DRAWS
        if efficiency > _GOOD or len(proposals) > rounds:
            return Adapted(proposals[-1], points, weights, efficiency)
        possible = np.isfinite(log_weights)
        few = possible.sum() < 5 * points.shape[1]  # all count alike: the proposal stays as it is
        least = min(_COUNTING, 0.9 * float(possible.sum()))
        flat = np.ones(len(points)) if few else tempered(log_weights, least)
        fitted = fit_student_mixture(points, flat, _COMPONENTS, 8.0, rng)
        proposals.append(fitted.with_component(first, 0.1))
        drawn = proposals[-1].sample(rng, _DRAWS)
        points = np.concatenate([points, drawn])
        target = np.concatenate([target, density(drawn)])


def _shifted(logs: list[Floats]) -> Floats:
    stacked = np.stack(logs)
    return stacked - stacked.max(axis=0)
