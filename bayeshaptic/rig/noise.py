"""Random signals of a given spectrum: excitation, tremor, wander."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.fft

from bayeshaptic.rig.dynamics.plant import Array


def shaped_noise(
    density: Callable[[Array], Array], samples: int, period_s: float, rng: np.random.Generator
) -> Array:
    """Gaussian noise with the power spectral density `density` (any scale) and a variance of 1.

    A stretch a quarter longer than asked for is made from its spectrum and cut, so that the end
    does not run into the beginning. The variance is that of the process, not of the stretch.

    Parameters
    ----------
    density : callable
        Frequencies in Hz, shape (F,), to densities, shape (F,).
    samples : int
    period_s : float
        Sampling period, s.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (samples,)

    Raises
    ------
    ValueError
        Where the density is zero on every line.
    """
    length = scipy.fft.next_fast_len(samples + samples // 4 + 16, real=True)
    frequency = np.fft.rfftfreq(length, period_s)
    shape = np.asarray(density(frequency), dtype=float)
    shape[0] = 0.0
    if length % 2 == 0:
        shape[-1] = 0.0
    total = shape.sum()
    if not total > 0:
        raise ValueError("the noise has no power between the lowest line and Nyquist")
    white = rng.normal(size=(2, len(frequency)))
    spectrum = (white[0] + 1j * white[1]) * np.sqrt(shape / total) * (length / 2)
    return np.fft.irfft(spectrum, length)[:samples]


def tremor_density(band_hz: tuple[float, float]) -> Callable[[Array], Array]:
    """The power spectral density of a tremor, in any scale.

    It is a hump over the band with skirts that fall with the fourth power of the frequency: the
    squared gain of two resonators in series, centred in the band, at a quarter of the top at its
    edges.

    Parameters
    ----------
    band_hz : tuple of float
        Lowest and highest frequency.

    Returns
    -------
    callable
        From frequencies in Hz to densities, as `shaped_noise` takes it.
    """
    low, high = band_hz
    centre, width = np.sqrt(low * high), high - low

    def density(frequency: Array) -> Array:
        f = np.maximum(frequency, 1e-9)
        return 1 / (1 + ((f**2 - centre**2) / (f * width)) ** 2) ** 2

    return density


def wander_density(corner_hz: float) -> Callable[[Array], Array]:
    """The power spectral density of a hand that wanders, in any scale.

    It is flat up to the corner, and falls with the eighth power of the frequency above it.

    Parameters
    ----------
    corner_hz : float

    Returns
    -------
    callable
        From frequencies in Hz to densities, as `shaped_noise` takes it.
    """

    def density(frequency: Array) -> Array:
        return 1 / (1 + (frequency / corner_hz) ** 8)

    return density
