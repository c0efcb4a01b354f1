"""How far estimates may be off where the residual is correlated, and not of the noise's shape."""

from __future__ import annotations

import numpy as np

from bayeshaptic.inference.time_domain.uneven import Ridge
from bayeshaptic.types import Floats

FREEDOM = 8  # cosines, and so degrees of freedom
SURELY = 3.83  # standard deviations (Student's t, `FREEDOM`) that chance exceeds 1 in 200 times
_SMOOTH, _FEWEST = 0.35, 6  # lines either side of one, as a share of its number, and at least


def covariance(
    columns: Floats, residual: Floats, found: Ridge, effective: float, named: int
) -> Floats:
    """Covariance of the solution, shape (C, C).

    The sum of what the priors leave open and of what the residual does.  That is told twice: by the
    scores' long-run variance, from their lowest cosines (E. Lazarus, D. J. Lewis, J. H. Stock and
    M. W. Watson, Journal of Business and Economic Statistics 36, 2018), and by the variance that a
    stationary residual of that spectrum would give.  Where it is one both say the same; of the
    first `named` values none has less than the larger of them.
    """
    inner = found.inverse
    lost = effective / max(effective - found.used, 0.2 * effective)
    slow = inner @ _cosines(columns, residual).T
    still = inner @ _stationary(columns, residual) @ inner.T
    held = inner * found.share
    return lost * _larger(slow @ slow.T / FREEDOM, still, named) + (held * found.prior) @ held.T


def of_white(residual: Floats, found: Ridge, effective: float) -> Floats:
    """Covariance of the solution where the residual is white, shape (C, C).

    `covariance` says the same of it, on average; but the larger of two variances, one of them from
    eight cosines, is a fifth more than either.
    """
    left = max(effective - found.used, 0.2 * effective)
    return np.asarray(found.inverse * float(residual @ residual) / left)


def _larger(one: Floats, other: Floats, named: int) -> Floats:
    """As much of the sum of two covariances as neither has more of any of the first variances.

    All of it alike: what is known of several values together stays known.
    """
    both = one + other
    most, whole = np.maximum(np.diag(one), np.diag(other))[:named], np.diag(both)[:named]
    return both * float(np.max(np.divide(most, whole, out=np.ones(named), where=most < whole)))


def spread_of(
    own: Floats, residual: Floats, along: Floats, found: Ridge, effective: float
) -> float:
    """Variance of the score of one more column, as `covariance` has that of the solution.

    Parameters
    ----------
    own : ndarray, shape (N,)
        What is left of the column when the others are fitted to it.
    residual : ndarray, shape (N,)
        When it is fitted, too.
    along : ndarray, shape (C,)
        The other columns' products with it.
    found : Ridge
        Of the other columns.
    effective : float
    """
    lost = effective / max(effective - found.used - 1, 0.2 * effective)
    slow = _cosines(own[:, None], residual)
    still = float(_stationary(own[:, None], residual)[0, 0])
    held = along @ (found.inverse * found.share)
    return float(lost * max(np.sum(slow**2) / FREEDOM, still) + held**2 @ found.prior)


def _cosines(columns: Floats, residual: Floats) -> Floats:
    """The scores' lowest cosine coefficients, shape (FREEDOM, C)."""
    middle = (np.arange(len(residual)) + 0.5) / len(residual)
    order = np.arange(1, FREEDOM + 1)[:, None]
    return np.asarray((np.sqrt(2) * np.cos(np.pi * order * middle) * residual) @ columns)


def _stationary(columns: Floats, residual: Floats) -> Floats:
    """Variance of the scores for a residual that is independent of the columns, shape (C, C)."""
    count = len(residual)
    taper = np.sqrt(8 / 3) * np.hanning(count)
    power = np.abs(np.fft.rfft(residual * taper)) ** 2 / count
    line = np.arange(len(power))
    half = np.maximum(_FEWEST, (_SMOOTH * line).astype(int))
    low, high = np.maximum(line - half, 0), np.minimum(line + half + 1, len(power))
    sums = np.append(0.0, np.cumsum(power))
    smooth = (sums[high] - sums[low]) / (high - low)
    weight = np.where(line == 0, 1.0, 2.0) * smooth / count
    spectra = np.fft.rfft(columns * taper[:, None], axis=0)
    return np.asarray(((spectra.conj() * weight[:, None]).T @ spectra).real)
