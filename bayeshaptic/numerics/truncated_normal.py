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


def spread_above(low: Floats, mean: Floats, root: Floats, draws: int) -> Floats:
    """Standard deviations (n,) of one normal distribution above `low`, from `draws` of it.

    Gibbs sampling along its principal axes: entry by entry, points would stay where they are on a
    ridge that is much longer than wide.  The same numbers in every call.

    Parameters
    ----------
    low : ndarray, shape (n,)
    mean : ndarray, shape (n,)
        Not below `low`.
    root : ndarray, shape (n, m)
        Of the covariance, root @ root.T: its square has lost the width of such a ridge.
    draws : int
    """
    rng = np.random.default_rng(0)
    axes, widths, _ = np.linalg.svd(root, full_matrices=False)
    points, sweeps = np.tile(mean, (draws, 1)), 20
    for _ in range(sweeps):
        for width, axis in zip(widths, axes.T, strict=True):
            beside = points - np.outer((points - mean) @ axis, axis)
            with np.errstate(divide="ignore", invalid="ignore"):
                ends = (low - beside) / (axis * width)
            begin = np.max(np.where(axis > 0, ends, -np.inf), axis=1)
            end = np.min(np.where(axis < 0, ends, np.inf), axis=1)
            moved = width * _one_between(begin, np.maximum(begin, end), rng)
            points = np.maximum(beside + np.outer(moved, axis), low)
    return np.asarray(points.std(axis=0))


def _one_between(low: Floats, high: Floats, rng: np.random.Generator) -> Floats:
    """A draw of a standard normal number between each pair of ends."""
    from scipy.special import log_ndtr, ndtri_exp

    # In the lower tail, through logarithms: the ends may be many standard deviations away.
    upper = low > 0
    low, high = np.where(upper, -high, low), np.where(upper, -low, high)
    share, log_high = rng.uniform(size=len(low)), log_ndtr(high)
    log_low = np.minimum(log_ndtr(low) - log_high, 0.0)
    drawn = ndtri_exp(log_high + np.log(share + (1 - share) * np.exp(log_low)))
    return np.where(upper, -1.0, 1.0) * np.clip(drawn, low, high)


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
