"""Rounding to encoder counts that repeats with the motion, and so hides from the scatter."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Floats, Ints

_ORDERS = np.arange(1, 100)  # of the rounding error's Fourier series


def hidden_rounding(position: Floats, harmonics: Ints, count: float) -> Floats:
    r"""Variance that rounding adds to lines of the DFT and that the periods' scatter cannot show.

    Of a motion whose increments are normal, of mean square D over a lag, the rounding error has
    from one period to another the covariance

    .. math:: R(D) = \sum_k e^{-2 \pi^2 k^2 (D + 2 \sigma^2)} / (2 \pi^2 k^2)

    in counts, sigma the noise before rounding (B. Widrow and I. Kollar, "Quantization Noise",
    Cambridge, 2008): no white noise where the motion takes several samples for a count.  What is
    recorded has increments of mean square D + 2 R(0) - 2 R(D).

    Parameters
    ----------
    position : ndarray, shape (M, p)
        M periods.
    harmonics : ndarray of int, shape (L,)
    count : float
        One encoder count; zero where there is none.

    Returns
    -------
    ndarray, shape (L,)
        For a DFT over the square root of the number of samples: what repeats gathers in the
        harmonics, hence M times its variance a sample.
    """
    floating_point = (np.finfo(float).eps * np.abs(position).max()) ** 2
    if not count > 0:
        return np.full(len(harmonics), floating_point)
    scatter = float(np.mean(np.var(position, axis=0, ddof=1))) / count**2
    sigma, _ = _repeated()
    noise = float(np.interp(scatter, _scatter(), sigma))
    mean = position.mean(axis=0) / count
    power = np.abs(np.fft.rfft(mean - mean.mean())) ** 2
    alike = np.fft.irfft(power, len(mean)) / len(mean)
    recorded = 2 * np.maximum(alike[0] - scatter / len(position) - alike, 0)
    recorded[0] = 0
    apart = np.concatenate([[0.0], np.geomspace(1e-6, 1e2, 400)])
    rounded = _covariance(apart, noise)
    apart_here = np.interp(recorded, apart + 2 * (rounded[0] - rounded), apart)
    spectrum = np.fft.rfft(np.interp(apart_here, apart, rounded)).real
    return np.asarray(
        len(position) * count**2 * np.maximum(spectrum[harmonics], 0) + floating_point
    )


def _covariance(apart: Floats, noise: float) -> Floats:
    """Of rounding errors whose motions are apart by a mean square, with noise before rounding."""
    squared = 2 * (np.pi * _ORDERS[:, None]) ** 2
    return np.asarray(np.sum(np.exp(-squared * (apart + 2 * noise**2)) / squared, axis=0))


def _repeated() -> tuple[Floats, Floats]:
    r"""Noise before rounding, and the variance of the part of the error that repeats, in counts.

    Noise of standard deviation :math:`\sigma` smooths the sawtooth of the rounding error, whose
    mean at a given position keeps the variance

    .. math:: r(\sigma) = \sum_k e^{-(2 \pi k \sigma)^2} / (2 \pi^2 k^2)

    and repeats.  Without noise all of it does, 1/12; with half a count of noise nearly nothing
    (non-subtractive dither; Widrow and Kollar).
    """
    sigma = np.linspace(0, 1, 201)
    repeated = _covariance(2 * sigma**2, 0.0)
    repeated[0] = 1 / 12
    return sigma, repeated


def _scatter() -> Floats:
    """Variance between periods of the same noise: sigma^2 + 1/12 - r."""
    sigma, repeated = _repeated()
    return np.asarray(sigma**2 + 1 / 12 - repeated)
