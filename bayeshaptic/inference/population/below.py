"""Draws of what lies below the hyperparameters: the device, the people, the recordings."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.inference.population.hierarchy import Hierarchy, inverse_and_log_det
from bayeshaptic.inference.population.hyperparameters import Hyperparameters
from bayeshaptic.numerics.truncated_normal import draw_above
from bayeshaptic.types import Bools, Floats


@dataclass(frozen=True)
class Below:
    """Joint draws of a hierarchy, n of them.

    Attributes
    ----------
    level : Hyperparameters
        The hyperparameters below which the draws lie, n of them.
    beta : ndarray, shape (n, q)
        Mean hand, then the device in each configuration; in the coordinates of the study, with the
        prior's mean added.
    recordings : ndarray, shape (n, R, D)
        Coordinates of every recording.
    """

    level: Hyperparameters
    beta: Floats = field(repr=False)
    recordings: Floats = field(repr=False)


def draw_below(
    hierarchy: Hierarchy,
    phi: Floats,
    walls: Floats,
    rng: np.random.Generator,
    spike: Floats | None = None,
) -> Below:
    """Draw device, people and recordings once below each vector of hyperparameters.

    A damper that the device does not have, because its draw is at the wall, is at the wall in all
    recordings of that configuration, too.  The odds of the wall are those of a device at the wall
    whose recordings scatter about it; where that scatter is large, a recording may rule out what
    it is then said to have, and not one draw in a thousand of that kind may outweigh all others.
    So such draws are accepted by how probable they leave the recordings (one at most), and drawn
    again from wall and rest alike where they are not.

    Parameters
    ----------
    hierarchy : Hierarchy
    phi : ndarray, shape (n, Q)
        Draws of the hyperparameters.
    walls : ndarray, shape (D,)
        Lowest value of each coordinate of the mean; -inf where there is none.
    rng : numpy.random.Generator
    spike : ndarray, shape (D,), optional
        How much the wall itself weighs: as much as so many of the standard deviations with which
        all recordings together know the coordinate.  By default the wall has no weight.

    Returns
    -------
    Below
        Drawn by conditioning a draw of prior and noise on what was seen (Matheron's rule; A. G.
        Journel, C. J. Huijbregts, "Mining Geostatistics", Academic Press 1978).
    """
    spike = np.zeros(len(walls)) if spike is None else spike
    chunk = 256
    beta = np.empty((len(phi), len(hierarchy.beta_sd)))
    recordings = np.empty((len(phi), *hierarchy.mean.shape))
    todo, rounds = np.arange(len(phi)), 10
    for number in range(rounds):
        # What is rejected all the time would never be accepted: off the wall in the end.
        some = spike if number < rounds - 1 else np.zeros(len(walls))
        rejected = []
        for own in np.split(todo, np.arange(chunk, len(todo), chunk)):
            beta[own], recordings[own], log_ratio = _draw(hierarchy, phi[own], walls, rng, some)
            rejected.append(own[-rng.standard_exponential(len(own)) > log_ratio])
        todo = np.concatenate(rejected)
        if todo.size == 0:
            break
    return Below(hierarchy.layout.read(phi), beta, recordings)


def _draw(
    hierarchy: Hierarchy, phi: Floats, walls: Floats, rng: np.random.Generator, spike: Floats
) -> tuple[Floats, Floats, Floats]:
    """`Below.beta` and `Below.recordings` for a part of the vectors phi, shape (b, Q).

    With it, of every draw, what `_at_walls` says of it; 0 where it is at no wall.
    """
    given = hierarchy.given(phi)
    order = np.concatenate([hierarchy.hand, *[hierarchy.device] * (int(hierarchy.place.max()) + 1)])
    low = (walls - hierarchy.prior_mean)[order]
    covariance, _ = inverse_and_log_det(given.precision)
    beta = draw_above(low, given.beta, covariance, rng, spike[order])
    people = given.draw_people(beta, rng)
    level = np.einsum("rip,bp->bri", hierarchy.design, beta)
    level[:, :, hierarchy.hand] += people[:, hierarchy.user]
    # Around that, by conditioning a draw of prior and noise on what was seen (Matheron's rule).
    sd = np.sqrt(given.spread)[:, None, :]
    guess = level + sd * rng.standard_normal(level.shape)
    roots = np.linalg.cholesky(hierarchy.covariance)
    noise = np.einsum("rij,brj->bri", roots, rng.standard_normal(level.shape))
    weight = hierarchy.weight(given.spread)
    x, middle = (
        around
        + given.spread[:, None, :] * np.einsum("brij,brj->bri", weight, hierarchy.mean - around - n)
        for around, n in ((guess, noise), (level, 0.0))
    )
    log_ratio = np.zeros(len(phi))
    if spike.any():
        at_wall = np.einsum("rip,bp->bri", hierarchy.design, np.where(beta == low, 1.0, 0.0)) > 0
        low = walls - hierarchy.prior_mean
        x, log_ratio = _at_walls(x, middle, at_wall, low, given.spread, weight)
    return beta + hierarchy.prior_mean[order], x + hierarchy.prior_mean, log_ratio


def _at_walls(
    x: Floats, middle: Floats, at_wall: Bools, low: Floats, spread: Floats, weight: Floats
) -> tuple[Floats, Floats]:
    """Recordings with some coordinates moved to their walls, the others conditioned on that.

    Parameters
    ----------
    x, middle : ndarray, shape (B, R, D)
        Coordinates of every recording and what is expected of them, less the prior's mean.
    at_wall : ndarray of bool, shape (B, R, D)
        Which of them are at their walls.
    low : ndarray, shape (D,)
        The walls, less the prior's mean.
    spread, weight : ndarray, shape (B, D), (B, R, D, D)
        Of the levels above the recordings, and what these say (`Hierarchy.weight`).

    Returns
    -------
    x : ndarray, shape (B, R, D)
    log_ratio : ndarray, shape (B,)
        Log of how probable the recordings are with those coordinates at the wall over that with a
        scatter about it: the density there given the recordings over that before them (J. M.
        Dickey, Annals of Mathematical Statistics 42, 1971).
    """
    spread = spread[:, None, :]
    left = -spread[..., None] * weight * spread[:, :, None, :]
    left += spread[..., None] * np.eye(x.shape[2])  # covariance about the levels, (B, R, D, D)
    log_ratio = np.zeros(len(x))
    for i in np.flatnonzero(at_wall.any(axis=(0, 1))):
        own = left[..., i, i]
        ratio = np.log(spread[..., i] / own) - (low[i] - middle[..., i]) ** 2 / own
        log_ratio += 0.5 * np.sum(np.where(at_wall[..., i], ratio, 0.0), axis=1)
        gain = left[..., i] / own[..., None] * at_wall[..., i, None]
        x, middle = (y + gain * (low[i] - y[..., i, None]) for y in (x, middle))
        left = left - gain[..., None] * left[..., i, None, :]
    return np.where(at_wall, low, x), log_ratio
