"""Describing each likelihood where all recordings together say that its parameters are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.population.gaussian_likelihood import (
    STEP,
    GaussianLikelihood,
    linearised,
)
from bayeshaptic.inference.population.hierarchy import Hierarchy
from bayeshaptic.inference.population.trend import Trend
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.numerics.truncated_normal import moments_above
from bayeshaptic.types import Floats

L = TypeVar("L", Hierarchy, Trend)
_SETTLED = 0.02  # move, in posterior standard deviations, that is none
# Posterior standard deviations that an expectation may lie outside a recording's own draws while
# it is looked for, and in the end: the one that was met lay 50 outside (rates are not counted).
_BEYOND, _FAR = 2.0, 5.0


def settled(level: L, posteriors: Sequence[Posterior], here: Coordinates, phi: Floats) -> L:
    """A study's levels with likelihoods linearised at the expected parameters given `phi`.

    Ridges of one recording are bent, and far longer than what the study leaves of them.  So each
    likelihood is described where the study expects the recording's parameters, with the model
    linear there.  That place depends on the descriptions, so both are found in turns (Newton's
    method, as in an iterated extended Kalman filter; B. M. Bell, F. W. Cathey, IEEE Transactions on
    Automatic Control 38, 1993).  A place stays near the recording's own draws, and moves by a
    standard deviation at a time at most.  Every second move is half as far, so that two points
    cannot take turns.  Eight rounds are made at most.

    Parameters
    ----------
    level : Hierarchy or Trend
    posteriors : sequence of Posterior
        One a recording.  Those without their measurement keep the description that they have.
    here : Coordinates
    phi : ndarray, shape (Q,)
        Hyperparameters.

    Returns
    -------
    Hierarchy or Trend
        `level` with its new descriptions.
    """
    sd, low, high = _own(posteriors, here)
    walls = here.lowest
    low, high = np.maximum(low - _BEYOND * sd, walls), high + _BEYOND * sd
    x = np.clip(_expected(level, phi, walls), low, high)
    rounds = 8
    for number in range(rounds):
        found = [
            linearised(one, here, x[r], STEP * sd[r]) or level.likelihoods[r]
            for r, one in enumerate(posteriors)
        ]
        level = replace(level, likelihoods=tuple(found))
        move = np.clip(_expected(level, phi, walls), low, high) - x
        far = np.max(np.abs(move) / sd, axis=1, keepdims=True)
        if np.all(far < _SETTLED):
            break
        x = x + (0.5 if number % 2 else 1.0) * move / np.maximum(far, 1.0)
    return level


def settled_nearby(
    level: L,
    own: Sequence[GaussianLikelihood],
    posteriors: Sequence[Posterior],
    here: Coordinates,
    phi: Floats,
) -> L:
    """As `settled`, but recordings that went astray keep the descriptions over their own draws.

    Where they did not, seven people whose hands differ by 1.5 were said to differ by 30: the
    description of one lay a hundred e-folds of a mass away.

    Parameters
    ----------
    level, posteriors, here, phi
        As in `settled`.
    own : sequence of GaussianLikelihood
        Over the draws of each recording.
    """
    level = settled(level, posteriors, here, phi)
    gone: set[int] = set()
    while more := set(astray(level, posteriors, here, phi)) - gone:
        gone |= more
        found = tuple(own[r] if r in gone else one for r, one in enumerate(level.likelihoods))
        level = replace(level, likelihoods=found)
    return level


def astray(
    level: Hierarchy | Trend, posteriors: Sequence[Posterior], here: Coordinates, phi: Floats
) -> list[int]:
    """Which recordings are expected to be where none of their own draws are near.

    Where a recording leaves a ridge or several peaks, its likelihood is no Gaussian function, and
    what is settled on may be far from all that the recording allows.

    Parameters
    ----------
    level, posteriors, here, phi
        As in `settled`.
    """
    sd, low, high = _own(posteriors, here)
    x, far = _expected(level, phi, here.lowest), _FAR * sd
    return np.flatnonzero(np.any((x < low - far) | (x > high + far), axis=1)).tolist()


def _own(posteriors: Sequence[Posterior], here: Coordinates) -> tuple[Floats, Floats, Floats]:
    """Standard deviation, least and most of every recording's own draws, each (R, D)."""
    own = [here.coordinate(one.draws) for one in posteriors]
    sd, low, high = (np.stack([of(x, axis=0) for x in own]) for of in (np.std, np.min, np.max))
    return sd, low, high


def _expected(level: Hierarchy | Trend, phi: Floats, walls: Floats) -> Floats:
    """The expected coordinates of every recording where none is below its wall, shape (R, D).

    Without the walls the point would run off to where there is no device: to dampers below zero,
    and all that goes with them along a ridge would follow.
    """
    mean, covariance = level.expected(phi)
    if not np.isfinite(walls).any():
        return mean
    every = zip(mean, covariance, strict=True)
    draws = 400
    return np.stack([moments_above(walls, m, c, draws)[0] for m, c in every])
