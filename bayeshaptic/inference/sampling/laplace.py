"""Laplace's approximation of the posterior, minding parameters that lean on a wall at zero."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.fit import weighted_residuals
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.numerics.mixture import StudentMixture, student
from bayeshaptic.numerics.truncated_normal import moments_above
from bayeshaptic.types import Floats

_STEP = 0.1  # of finite differences, in conditional standard deviations
_MARGIN = 2.5 * _STEP  # from where second differences stay inside the support


def laplace(density: Density, phi: Floats) -> tuple[Floats, StudentMixture]:
    """A Student t proposal around the peak of the posterior near `phi`.

    The peak is first found with the walls taken away.  Where it lies within a standard deviation
    of a wall or behind it, the parameter is set to the mean of its truncated normal, the others
    are optimised again, and the curvature is taken there: at the peak itself it would describe a
    place the posterior does not visit.

    Parameters
    ----------
    density : Density
    phi : ndarray, shape (P,)
        Where to start: a least-squares fit.

    Returns
    -------
    peak : ndarray, shape (P,)
        Inside the walls.
    proposal : StudentMixture
    """
    here = density.coordinates
    widths = np.minimum(_conditional_widths(density, phi), here.high - here.low)
    phi = _within(density, phi, widths)
    everything = np.ones(len(phi), bool)
    peak = _climb(density, phi, everything, widths)
    covariance = _inverse(-_hessian(density, peak, widths))
    sd = np.sqrt(np.diag(covariance))
    # Walls are of parameters by themselves, and a coordinate may be what is left beside another.
    low = here.low - (here.own(peak) - peak)
    leaning = here.walls & ((peak - low) < sd)
    if not leaning.any():
        return _possible(density, peak, phi), student(peak, covariance)

    block = covariance[np.ix_(leaning, leaning)]
    draws = 2000  # for the moments of a truncated normal
    mean, spread = moments_above(low[leaning], peak[leaning], block, draws)
    # Along the ridge: across it, the others would not find their way back.
    along = np.linalg.solve(block, mean - peak[leaning])
    inside = peak + covariance[:, leaning] @ along
    inside = np.where(here.walls, np.maximum(inside, low), inside)
    inside[leaning] = mean
    inside = _within(density, inside, widths)
    inside = _climb(density, inside, ~leaning, widths)
    curvature = -_hessian(density, inside, widths)
    others = ~leaning
    within = _inverse(curvature[np.ix_(others, others)])
    slope = -within @ curvature[np.ix_(others, leaning)]
    full = np.empty_like(covariance)
    full[np.ix_(leaning, leaning)] = spread
    full[np.ix_(others, leaning)] = slope @ spread
    full[np.ix_(leaning, others)] = (slope @ spread).T
    full[np.ix_(others, others)] = within + slope @ spread @ slope.T
    return _possible(density, inside, phi), student(inside, full)


def _conditional_widths(density: Density, phi: Floats) -> Floats:
    """How far each coordinate alone can move before the fit suffers, shape (P,)."""
    residuals = weighted_residuals(density.likelihood, density.coordinates)
    slope = jacobian(residuals, phi[None])[0]
    slope = np.where(np.isfinite(slope), slope, 0.0)  # beside the end of what has a response
    return 1 / np.sqrt(1 + np.sum(slope**2, axis=0))


def _possible(density: Density, peak: Floats, start: Floats) -> Floats:
    """`peak`, or `start` where walls that lean on each other have pushed it out of the support."""
    return peak if np.isfinite(density(peak[None])[0]) else start


def _within(density: Density, phi: Floats, widths: Floats) -> Floats:
    """`phi` a little inside those ends of the support that are no walls.

    Beyond a wall the prior goes on as it begins; beyond other ends there is nothing, and
    differences would find neither slope nor curvature.
    """
    here = density.coordinates
    low = np.where(here.walls, -np.inf, here.low + _MARGIN * widths)
    own = here.own(phi)  # the support is that of each parameter by itself
    return phi + np.clip(own, low, here.high - _MARGIN * widths) - own


def _climb(density: Density, phi: Floats, free: NDArray[np.bool_], widths: Floats) -> Floats:
    """Damped Newton steps up the log posterior in the free coordinates."""
    phi = phi.copy()
    value = float(density.beyond_walls(phi)[0])
    damping = 1e-3
    settled = 1e-2  # gain of log density that is none
    steps = 30  # at most
    for _ in range(steps):
        gradient = _gradient(density, phi[None], widths)[0][free] * widths[free]
        scaled = np.outer(widths, widths) * _hessian(density, phi, widths)
        eigenvalues, vectors = np.linalg.eigh(-scaled[np.ix_(free, free)])
        eigenvalues = np.maximum(np.abs(eigenvalues), 1e-9 * np.abs(eigenvalues).max())
        for _ in range(12):
            move = vectors @ ((vectors.T @ gradient) / (eigenvalues * (1 + damping) + damping))
            trial = phi.copy()
            trial[free] += np.clip(move * widths[free], -1.0, 1.0)
            trial = _within(density, trial, widths)
            trial_value = float(density.beyond_walls(trial)[0])
            if trial_value >= value:
                break
            damping = max(damping, 1e-3) * 10
        else:
            return phi
        gain = trial_value - value
        phi, value, damping = trial, trial_value, damping * 0.1
        if gain < settled:
            break
    return phi


def _gradient(density: Density, phi: Floats, widths: Floats) -> Floats:
    """Central differences of the log posterior for a batch, (B, P) to (B, P)."""
    count, size = phi.shape
    moves = np.diag(_STEP * widths)
    moves = np.concatenate([moves, -moves])
    values = density.beyond_walls((phi[:, None, :] + moves).reshape(-1, size))
    values = values.reshape(count, 2, size)
    with np.errstate(invalid="ignore"):  # where both sides are impossible, the data say nothing
        slopes = (values[:, 0] - values[:, 1]) / (2 * _STEP * widths)
    return np.nan_to_num(slopes, nan=0.0, posinf=0.0, neginf=0.0)


def _hessian(density: Density, phi: Floats, widths: Floats) -> Floats:
    """Finite differences of the gradient, shape (P, P)."""
    size = len(phi)
    moves = np.diag(_STEP * widths)
    slopes = _gradient(density, phi + np.concatenate([moves, -moves]), widths)
    hessian = (slopes[:size] - slopes[size:]) / (2 * _STEP * widths[:, None])
    return 0.5 * (hessian + hessian.T)


def _inverse(curvature: Floats) -> Floats:
    """Inverse of a matrix that should be positive definite; flat or wrong directions get width 1.

    A coordinate is a logarithm or a multiple of the prior's width: width 1 is a wide guess.
    """
    eigenvalues, vectors = np.linalg.eigh(curvature)
    return (vectors / np.maximum(eigenvalues, 1.0)) @ vectors.T
