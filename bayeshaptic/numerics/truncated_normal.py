"""Draws from normal distributions that are cut off from below."""

from __future__ import annotations

import numpy as np
from scipy.special import expit

from bayeshaptic.types import Floats


def draw_above(
    low: Floats,
    mean: Floats,
    covariance: Floats,
    rng: np.random.Generator,
    spike: Floats | None = None,
) -> Floats:
    """A draw of each normal distribution, shape (B, n), with entries not below `low`.

    The entries with a wall within reach by Gibbs sampling of their own distribution, then the
    others given them: one that is far from its wall, but whose sum with one next to its own is
    known, would hold that back.

    Parameters
    ----------
    low : ndarray, shape (n,)
        -inf where there is no wall.
    mean : ndarray, shape (B, n)
    covariance : ndarray, shape (B, n, n)
    rng : numpy.random.Generator
    spike : ndarray, shape (n,), optional
        The wall itself may be the value: with as much probability as lies in so many of the
        entry's standard deviations beside it, were the density there what it is at the wall.
    """
    draw = mean + np.einsum(
        "bij,bj->bi", np.linalg.cholesky(covariance), rng.standard_normal(mean.shape)
    )
    width = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    reach = 6.0  # standard deviations
    walled = np.flatnonzero(np.any(mean - low < reach * width, axis=0))
    spikes = np.zeros(len(low)) if spike is None else spike
    if walled.size == 0 or (np.all(draw >= low) and not spikes[walled].any()):
        return draw
    precision = np.linalg.inv(covariance[:, walled][:, :, walled])
    inside = np.maximum(draw[:, walled], low[walled])
    sweeps = 20
    for _ in range(sweeps):
        for i, entry in enumerate(walled):
            off = inside - mean[:, walled]
            off[:, i] = 0.0
            sd = 1 / np.sqrt(precision[:, i, i])
            centre = mean[:, entry] - sd**2 * np.einsum("bj,bj->b", precision[:, i], off)
            at_wall = spikes[entry] * width[:, entry]
            inside[:, i] = _one_above(float(low[entry]), centre, sd, at_wall, rng)
    change = np.einsum("bij,bj->bi", precision, inside - draw[:, walled])
    draw = draw + np.einsum("bij,bj->bi", covariance[:, :, walled], change)
    draw[:, walled] = inside
    return draw


def moments_above(
    low: Floats, mean: Floats, covariance: Floats, draws: int
) -> tuple[Floats, Floats]:
    """Mean (n,) and covariance (n, n) of one normal distribution above `low`, from `draws` of it.

    The same numbers in every call.
    """
    means, covariances = np.tile(mean, (draws, 1)), np.tile(covariance, (draws, 1, 1))
    points = draw_above(low, means, covariances, np.random.default_rng(0))
    return points.mean(axis=0), np.atleast_2d(np.cov(points.T))


def _one_above(
    low: float, centre: Floats, sd: Floats, spike: Floats, rng: np.random.Generator
) -> Floats:
    """A draw of each normal distribution of one number, or the wall."""
    from scipy.special import log_ndtr, ndtri_exp

    # In the upper tail, through logarithms: the wall may be many standard deviations above.
    away = (centre - low) / sd
    log_tail = log_ndtr(away)
    beside = centre - sd * ndtri_exp(log_tail + np.log(rng.uniform(size=len(centre))))
    if not spike.any():
        return np.asarray(beside)
    # Odds of the wall: the density there times what the spike weighs (Savage and Dickey).
    log_odds = np.log(spike / (np.sqrt(2 * np.pi) * sd)) - 0.5 * away**2 - log_tail
    return np.where(rng.uniform(size=len(centre)) < expit(log_odds), low, beside)
