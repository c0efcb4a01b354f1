"""Least squares from many starts at once: damped Gauss-Newton steps on a batch, within bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Residuals = Callable[[Floats], Floats]
_STEP = 1e-6


def jacobian(residuals: Residuals, phi: Floats, at: Floats | None = None) -> Floats:
    """Forward differences: from (B, P) to (B, N, P), in one call for the whole batch."""
    count, size = phi.shape
    at = residuals(phi) if at is None else at
    moved = np.repeat(phi, size, axis=0)
    moved[np.arange(count * size), np.tile(np.arange(size), count)] += _STEP
    shifted = residuals(moved).reshape(count, size, -1)
    return np.transpose((shifted - at[:, None, :]) / _STEP, (0, 2, 1))


def minimise(
    residuals: Residuals, start: Floats, low: Floats, high: Floats, steps: int, tolerance: float
) -> tuple[Floats, Floats]:
    """Minimise the sum of squares from every start.

    Levenberg's damping, raised where a step does not help and lowered where it does.  A parameter
    on a bound that the gradient pushes outwards is left there for the step.

    Parameters
    ----------
    residuals : callable
        From (B, P) to (B, N).
    start : ndarray, shape (B, P)
    low, high : ndarray, shape (P,)
    steps : int
        At most so many.
    tolerance : float
        Stop when no start gains more than this in half its sum of squares.

    Returns
    -------
    phi : ndarray, shape (B, P)
    cost : ndarray, shape (B,)
        Half the sum of squares.
    """
    phi = np.clip(start, low, high)
    value = residuals(phi)
    cost = _half_square(value)
    damping = np.full(len(phi), 1e-2)
    for _ in range(steps):
        slope = jacobian(residuals, phi, value)
        trial = np.clip(phi + _damped_step(slope, value, damping, phi, low, high), low, high)
        trial_value = residuals(trial)
        trial_cost = _half_square(_finite(trial_value))
        better = trial_cost < cost
        gain = np.where(better, cost - trial_cost, 0.0)
        phi = np.where(better[:, None], trial, phi)
        value = np.where(better[:, None], trial_value, value)
        cost = np.where(better, trial_cost, cost)
        damping = np.where(better, damping * 0.2, damping * 8.0)
        settled = np.where(better, gain < tolerance, damping > 1e6)
        if settled.all():
            break
    return phi, cost


def _finite(value: Floats) -> Floats:
    """A step into the impossible counts as an infinitely bad one."""
    return np.where(np.isfinite(value), value, 1e150)


def _half_square(value: Floats) -> Floats:
    return 0.5 * np.einsum("bn,bn->b", value, value)


def _damped_step(
    slope: Floats, value: Floats, damping: Floats, phi: Floats, low: Floats, high: Floats
) -> Floats:
    size = slope.shape[2]
    normal = slope.transpose(0, 2, 1) @ slope
    gradient = np.einsum("bnp,bn->bp", slope, value)
    held = ((phi <= low) & (gradient > 0)) | ((phi >= high) & (gradient < 0))
    diagonal = np.einsum("bpp->bp", normal) + 1e-12
    normal[:, np.arange(size), np.arange(size)] = diagonal * (1 + damping[:, None])
    normal = np.where(held[:, :, None] | held[:, None, :], 0.0, normal)
    normal[:, np.arange(size), np.arange(size)] += np.where(held, 1.0, 1e-300)
    gradient = np.where(held, 0.0, gradient)
    step = np.linalg.solve(normal, -gradient[:, :, None])[:, :, 0]
    # Logarithmic coordinates: no more than a factor e a step.
    return np.clip(step, -1.0, 1.0)
