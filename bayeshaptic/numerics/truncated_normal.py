"""Draws from normal distributions that are cut off from below."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Floats


def draw_above(low: Floats, mean: Floats, covariance: Floats, rng: np.random.Generator) -> Floats:
    """A draw of each normal distribution, shape (B, n), with entries not below `low`.

    The entries with a wall by Gibbs sampling of their own distribution, then the others given them.

    Parameters
    ----------
    low : ndarray, shape (n,)
        -inf where there is no wall.
    mean : ndarray, shape (B, n)
    covariance : ndarray, shape (B, n, n)
    rng : numpy.random.Generator
    """
    draw = mean + np.einsum(
        "bij,bj->bi", np.linalg.cholesky(covariance), rng.standard_normal(mean.shape)
    )
    walled = np.flatnonzero(np.isfinite(low))
    if walled.size == 0 or np.all(draw[:, walled] >= low[walled]):
        return draw
    precision = np.linalg.inv(covariance[:, walled][:, :, walled])
    inside = np.maximum(draw[:, walled], low[walled])
    sweeps = 20
    for _ in range(sweeps):
        for i in range(len(walled)):
            off = inside - mean[:, walled]
            off[:, i] = 0.0
            sd = 1 / np.sqrt(precision[:, i, i])
            centre = mean[:, walled[i]] - sd**2 * np.einsum("bj,bj->b", precision[:, i], off)
            inside[:, i] = _one_above(float(low[walled[i]]), centre, sd, rng)
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


def _one_above(low: float, centre: Floats, sd: Floats, rng: np.random.Generator) -> Floats:
    """A draw of each normal distribution of one number."""
    from scipy.special import log_ndtr, ndtri_exp

    # In the upper tail, through logarithms: the wall may be many standard deviations above.
    log_tail = log_ndtr((centre - low) / sd)
    return np.asarray(centre - sd * ndtri_exp(log_tail + np.log(rng.uniform(size=len(centre)))))
