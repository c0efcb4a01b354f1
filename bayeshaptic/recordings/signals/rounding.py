"""Rounding to encoder counts that repeats with the motion, and so hides from the scatter."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def hidden_rounding(position: NDArray[Any], count: float | None = None) -> float:
    """Variance that rounding adds to a line of the DFT and that the periods' scatter cannot show.

    Parameters
    ----------
    position : ndarray, shape (M, p)
        M periods.
    count : float, optional
        One encoder count; the smallest increment of the position by default.

    Returns
    -------
    float
        For a DFT over the square root of the number of samples: what repeats gathers in the
        harmonics, hence M times its variance a sample.
    """
    increments = np.abs(np.diff(position.ravel()))
    if count is None:
        count = float(np.min(increments[increments > 0], initial=np.inf))
    floating_point = (np.finfo(float).eps * np.abs(position).max()) ** 2
    scatter = np.mean(np.var(position, axis=0, ddof=1))
    repeated = count**2 * repeated_rounding(scatter / count**2)
    return float(len(position) * repeated + floating_point)


def repeated_rounding(scatter: float) -> float:
    r"""Variance of the part of the rounding to whole counts that is the same in each period.

    Noise of standard deviation :math:`\sigma` before rounding smooths the sawtooth of the rounding
    error, whose mean at a given position keeps the variance

    .. math:: r(\sigma) = \sum_k e^{-(2 \pi k \sigma)^2} / (2 \pi^2 k^2)

    and repeats; the scatter between periods is :math:`\sigma^2 + 1/12 - r`. Without noise all of it
    repeats, 1/12; with half a count of noise nearly nothing (non-subtractive dither, B. Widrow and
    I. Kollar, "Quantization Noise", Cambridge, 2008).

    Parameters
    ----------
    scatter : float
        Variance between periods, square counts.

    Returns
    -------
    float
        r, square counts.
    """
    sigma, k = np.linspace(0, 1, 201), np.arange(1, 100)[:, None]
    repeated = np.sum(np.exp(-((2 * np.pi * k * sigma) ** 2)) / (2 * np.pi**2 * k**2), axis=0)
    repeated[0] = 1 / 12
    return float(np.interp(scatter, sigma**2 + 1 / 12 - repeated, repeated))
