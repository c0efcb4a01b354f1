"""Least squares from many starts at once: damped Gauss-Newton steps on a batch, within bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayeshaptic.types import Floats

Residuals = Callable[[Floats], Floats]
# The root of the largest relative noise of a response: 1e-16, but 1e-10 with a lag of third order,
# whose equal poles are moved apart to have partial fractions.
_STEP = 1e-5
_LEAST = 0.2  # by which damping falls after a step
_ROUNDED = 1e-13  # damping below it is lost in rounding, and nothing parts equal directions
_TINY = 1e-12
_FEW = 8  # a call costs 0.1 ms, a vector 3 us, and four steps in ten do not win


def jacobian(residuals: Residuals, phi: Floats, at: Floats | None = None) -> Floats:
    """Forward differences: from (B, P) to (B, N, P), in one call for the whole batch."""
    at = residuals(phi) if at is None else at
    return np.transpose(_slopes(residuals, phi, at), (0, 2, 1))


def _slopes(residuals: Residuals, phi: Floats, at: Floats) -> Floats:
    """Forward differences a parameter at a time, (B, P, N)."""
    count, size = phi.shape
    moved = np.repeat(phi, size, axis=0)
    moved[np.arange(count * size), np.tile(np.arange(size), count)] += _STEP
    return _differences(residuals(moved).reshape(count, size, -1), at[:, None, :])


def _with_slopes(residuals: Residuals, phi: Floats) -> tuple[Floats, Floats]:
    """Residuals (B, N) and their forward differences (B, P, N), in one call: the same numbers."""
    count, size = phi.shape
    points = np.repeat(phi, size + 1, axis=0).reshape(count, size + 1, size)
    points[:, np.arange(size), np.arange(size)] += _STEP
    all_ = residuals(points.reshape(-1, size)).reshape(count, size + 1, -1)
    return all_[:, -1], _differences(all_[:, :-1], all_[:, -1:])


def _differences(shifted: Floats, at: Floats) -> Floats:
    """Slopes in the place of `shifted`: these are megabytes."""
    shifted -= at
    shifted /= _STEP
    return shifted


def lengths(columns: Floats) -> Floats:
    """Of columns, shape (C,), to divide them by: one of a column of zeros."""
    found = np.linalg.norm(columns, axis=0)
    return np.where(found > 0, found, 1.0)


def root_of_covariance(slope: Floats, widest: float = 1.0) -> Floats:
    """A root of the covariance of parameters, shape (P, P): root @ root.T.

    Of the triangle of the slopes, not of its square: that has lost what is known worst to rounding.

    Parameters
    ----------
    slope : ndarray, shape (N, P)
        Of residuals of unit variance.
    widest : float
        Standard deviation, beside the data's, of a direction that they do not see.
    """
    known = np.concatenate([slope, np.eye(slope.shape[1]) / widest])
    return np.asarray(np.linalg.inv(np.linalg.qr(known, mode="r")))


def minimise(
    residuals: Residuals,
    start: Floats,
    low: Floats,
    high: Floats,
    steps: int,
    tolerance: float,
    share: float = 0.0,
) -> tuple[Floats, Floats]:
    """Minimise the sum of squares from every start.

    Levenberg's damping, raised where a step does not help, by more each time, and lowered as far as
    one has gained what the slopes promised (H. B. Nielsen, Damping parameter in Marquardt's method,
    1999).  A parameter on a bound that the gradient pushes outwards is left there for the step.

    Parameters
    ----------
    residuals : callable
        From (B, P) to (B, N).
    start : ndarray, shape (B, P)
    low, high : ndarray, shape (P,)
    steps : int
        At most so many.
    tolerance : float
        A start rests when it gains less than this in half its sum of squares,
    share : float
        or than this share of that.

    Returns
    -------
    phi : ndarray, shape (B, P)
    cost : ndarray, shape (B,)
        Half the sum of squares.
    """
    phi = np.clip(start, low, high)
    value, slope = _with_slopes(residuals, phi)
    cost, normal, gradient = _half_square(value), *_normal_equations(slope, value)
    damping, harder = np.full(len(phi), 1e-2), np.full(len(phi), 2.0)
    open_ = np.arange(len(phi))  # starts that still move
    for _ in range(steps):
        here = phi[open_]
        step = _damped_step(normal[open_], gradient[open_], damping[open_], here, low, high)
        trial = np.clip(here + step, low, high)
        # Of many starts slopes are asked for only where the step has won; of a few in the same
        # call, which then costs more than what it is asked for.
        many = len(open_) > _FEW
        value, slopes = (residuals(trial), None) if many else _with_slopes(residuals, trial)
        promised = _promised(normal[open_], gradient[open_], trial - here)
        with np.errstate(
            invalid="ignore", over="ignore"
        ):  # a step into the impossible wins nothing
            gain = cost[open_] - _half_square(value)
            trust = gain / np.maximum(promised, _TINY)
        better = gain > 0
        if better.any():
            won, value = open_[better], value[better]
            if slopes is None:
                slope = _slopes(residuals, trial[better], value)
            else:
                slope = slopes[better]
            phi[won] = trial[better]
            cost[won] -= gain[better]
            normal[won], gradient[won] = _normal_equations(slope, value)
        lower = np.clip(1 - (2 * np.clip(trust, 0, 1) - 1) ** 3, _LEAST, None)
        damping[open_] *= np.where(better, lower, harder[open_])
        harder[open_] = np.where(better, 2.0, 2 * harder[open_])
        enough = np.maximum(tolerance, share * cost[open_])
        settled = np.where(better, gain < enough, damping[open_] > 1e6)
        open_ = open_[~settled]
        if not len(open_):
            break
    return phi, cost


def _half_square(value: Floats) -> Floats:
    return 0.5 * np.einsum("bn,bn->b", value, value)


def _normal_equations(slope: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Curvature of half the sum of squares as if linear, (B, P, P), and its slope, (B, P)."""
    return slope @ slope.transpose(0, 2, 1), (slope @ value[:, :, None])[:, :, 0]


def _promised(normal: Floats, gradient: Floats, step: Floats) -> Floats:
    """What each start would gain if its residuals were linear."""
    bent = (step[:, None, :] @ normal @ step[:, :, None])[:, 0, 0]
    return -np.einsum("bp,bp->b", gradient, step) - 0.5 * bent


def _damped_step(
    normal: Floats, gradient: Floats, damping: Floats, phi: Floats, low: Floats, high: Floats
) -> Floats:
    """The step of each start; `normal`, a copy, is changed."""
    size = normal.shape[2]
    held = ((phi <= low) & (gradient > 0)) | ((phi >= high) & (gradient < 0))
    diagonal = np.einsum("bpp->bp", normal) + 1e-12
    normal[:, np.arange(size), np.arange(size)] = diagonal * (
        1 + np.maximum(damping, _ROUNDED)[:, None]
    )
    normal = np.where(held[:, :, None] | held[:, None, :], 0.0, normal)
    normal[:, np.arange(size), np.arange(size)] += np.where(held, 1.0, 1e-300)
    gradient = np.where(held, 0.0, gradient)
    step = np.linalg.solve(normal, -gradient[:, :, None])[:, :, 0]
    # Logarithmic coordinates: no more than a factor e a step.
    return np.clip(step, -1.0, 1.0)
