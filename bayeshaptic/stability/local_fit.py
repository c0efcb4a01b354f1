"""The measured response around a frequency: local polynomials through the windows of an ETFE."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma

from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.types import Complexes, Floats

_RICHER = 5  # degree of the polynomial that tells whether a window is too wide
_SPANS = np.geomspace(0.6, 0.02, 14)  # half widths over the centre frequency, widest first
_ALIKE = 1e10  # condition above which nodes are too few places: those of pieces are the same
_OUTLIER = 1.6  # share of its own noise variance that a window keeps at least: a tremor is a peak


@dataclass(frozen=True)
class ResponseData:
    """Estimates of G at the nodes of W windows.

    Attributes
    ----------
    frequency_hz : ndarray, shape (W, k)
    response : ndarray of complex, shape (W, k)
    design : ndarray of complex, shape (W, k, k)
        ``design @ response`` has independent noise of variance 1 in each component.
    centre_hz : ndarray, shape (W,)
    linear : ndarray of bool, shape (W,)
        Where 1/G is linear in the noise: what it bends by in the direction that is known least is
        less than the noise of the one that is known best.  Lines that a sweep hardly excites
        leave sums of neighbours that are known to a thousandth, and responses that are noise.
    """

    frequency_hz: Floats
    response: Complexes
    design: Complexes
    centre_hz: Floats
    linear: NDArray[np.bool_]


def response_data(etfe: Etfe, sensor: Callable[[Floats], Complexes] | None = None) -> ResponseData:
    """Estimates of G from the windows of the likelihood, without those that are mostly noise.

    Parameters
    ----------
    etfe : Etfe
    sensor : callable, optional
        Of frequencies (L,): what the sensor of a measured force multiplies the response by.
    """
    windows = compress(etfe)
    k = windows.frequency_hz.shape[1]
    noise = _noise(windows.scatter, np.maximum(windows.lines - k, 1.0))
    design = windows.design
    if sensor is not None:
        nodes = windows.frequency_hz
        design = design * sensor(nodes.ravel()).reshape(nodes.shape)[:, None, :]
    response = np.linalg.solve(design, windows.target[..., None])[..., 0]
    design = design / np.sqrt(noise)[:, None, None]
    strength = np.linalg.norm(design * response[:, None, :], axis=(1, 2)) / np.sqrt(k)
    noisiest = 0.3  # relative sd above which 1/G is not linear in the noise
    good = strength > 1 / noisiest
    frequency, response, design = windows.frequency_hz[good], response[good], design[good]
    known = np.linalg.svd(design * response[:, None, :], compute_uv=False)  # over the noise
    linear = np.minimum(known[:, -1], known[:, -1] ** 2 / known[:, 0]) > 1
    return ResponseData(frequency, response, design, frequency.mean(axis=1), linear)


def _noise(scatter: Floats, freedom: Floats) -> Floats:
    """Noise variance of each window, from its neighbours too: alone it has few degrees of freedom.

    The logarithms are averaged, so that a steep spectrum does no harm; a window that stands far
    out of its neighbours keeps most of its own.
    """
    own = scatter / freedom
    unbiased = np.log(own) - digamma(freedom) + np.log(freedom)
    neighbours = 4  # windows on each side that share their noise variance
    padded = np.pad(unbiased, neighbours, mode="reflect", reflect_type="odd")
    together = np.convolve(padded, np.ones(2 * neighbours + 1), "valid") / (2 * neighbours + 1)
    return np.maximum(np.exp(together), own / _OUTLIER)


@dataclass(frozen=True)
class LocalFit:
    """A polynomial in x = (f - f0) / (h f0), for 1/G or for G (f/f0)^2.

    Attributes
    ----------
    centre_hz, span : float
        f0 and h.
    inverted : bool
        True for 1/G, which is smooth beside resonances; False for G (f/f0)^2, which is smooth
        beside antiresonances and for a mass.
    low_hz, high_hz : float
        What the data under it cover.
    coefficients : ndarray of complex, shape (6,)
    covariance : ndarray of complex, shape (6, 6)
        E[d d^H] of the coefficients; real and imaginary parts have half each.
    """

    centre_hz: float
    span: float
    inverted: bool
    low_hz: float
    high_hz: float
    coefficients: Complexes
    covariance: Complexes

    @property
    def inverse(self) -> complex:
        """1/G at the centre."""
        value = complex(self.coefficients[0])
        return value if self.inverted else 1 / value

    @property
    def relative_sd(self) -> float:
        """Standard deviation of the real and of the imaginary part at the centre, over |G|."""
        return float(np.sqrt(self.covariance[0, 0].real / 2) / abs(self.coefficients[0]))

    def covers(self, margin: float) -> bool:
        """Whether the centre is among its data, or beside them by a share `margin` at most."""
        low, high = self.low_hz / (1 + margin), self.high_hz * (1 + margin)
        return low <= self.centre_hz <= high

    def draws(self, rng: np.random.Generator, count: int, frequency_hz: Floats) -> Complexes:
        """Draw 1/G from what the data leave open.

        Parameters
        ----------
        rng : numpy.random.Generator
        count : int
        frequency_hz : ndarray, shape (L,)

        Returns
        -------
        ndarray of complex, shape (count, L)
            Each row is one polynomial, its coefficients drawn from their covariance.
        """
        # Not Cholesky's factor: directions that the data hardly see round to below zero.
        values, vectors = np.linalg.eigh(self.covariance / 2)
        half = vectors * np.sqrt(np.maximum(values, 0.0))
        noise = rng.standard_normal((2, count, len(half)))
        coefficients = self.coefficients + (noise[0] + 1j * noise[1]) @ half.T
        value = coefficients @ _powers(frequency_hz, self.centre_hz, self.span, _RICHER).T
        return value if self.inverted else (frequency_hz / self.centre_hz) ** 2 / value


def local_fit(data: ResponseData, centre_hz: float) -> LocalFit | None:
    """The quintic with the least noise where a cubic is enough; None where data are too few.

    Of 1/G and G (f/f0)^2, each over a span a little narrower than the widest that a cubic
    describes: there a quintic gains less than noise would let it, and what is left is as large as
    the noise.  The quintic is taken all the same: the span was chosen for the cubic's variance to
    be as large as its bias, which an interval must not have (S. Calonico, M. D. Cattaneo and
    R. Titiunik, "Robust nonparametric confidence intervals for regression-discontinuity designs",
    Econometrica 82, 2014).  Where not even the narrowest span passes, the covariance is scaled by
    what is left.

    Parameters
    ----------
    data : ResponseData
    centre_hz : float
    """
    fits = [_widest(data, centre_hz, inverted) for inverted in (True, False)]
    return min((fit for fit in fits if fit), key=lambda fit: fit.relative_sd, default=None)


def _widest(data: ResponseData, centre_hz: float, inverted: bool) -> LocalFit | None:
    """The fit two spans below the widest that passes, or the narrowest that there is."""
    last, accepted = None, 0
    order = 3
    better = 5.0  # gain in chi-square by the richer polynomial that noise exceeds in 4 % of cases
    narrower = 2  # steps from the widest span where a cubic passes
    away = np.abs(data.centre_hz / centre_hz - 1)
    within = away <= _SPANS[0]
    every = _equations(data, within, centre_hz, _SPANS[0], inverted)
    for span in _SPANS:
        near = away <= span
        if inverted:
            near &= data.linear
        numbers = int(near.sum()) * data.frequency_hz.shape[1]
        freedom, richer = numbers - order - 1, numbers - _RICHER - 1
        if richer < 2:
            break
        # The triangle of both polynomials: what is left of the target stands in its last column.
        equations = every[near[within]].reshape(-1, _RICHER + 2)
        triangle: Complexes = np.asarray(np.linalg.qr(equations, mode="r"))
        triangle[:, :-1] *= (_SPANS[0] / span) ** np.arange(_RICHER + 1)  # its own powers
        if np.linalg.cond(triangle[:-1, :-1]) > _ALIKE:
            break
        left = np.cumsum(np.abs(triangle[::-1, -1]) ** 2)[::-1]  # by k coefficients: at k
        fewer, more = float(left[order + 1]), float(left[_RICHER + 1])
        enough = fewer - more < better and fewer < freedom + 3 * np.sqrt(1.2 * freedom)
        accepted += enough or accepted > 0
        last = float(span), near, triangle, 1.0 if enough else max(more / richer, 1.0)
        if accepted > narrower:
            break
    return None if last is None else _fit(data, centre_hz, inverted, *last)


def _fit(
    data: ResponseData,
    centre_hz: float,
    inverted: bool,
    span: float,
    near: NDArray[np.bool_],
    triangle: Complexes,
    noise: float,
) -> LocalFit:
    """The solution of triangular equations, with `noise` times its covariance."""
    size = _RICHER + 1
    inverse = np.linalg.inv(triangle[:size, :size])
    used = data.frequency_hz[near]
    return LocalFit(
        centre_hz,
        span,
        inverted,
        float(used.min()),
        float(used.max()),
        (inverse @ triangle[:size, -1]).astype(complex),
        (inverse @ inverse.conj().T * noise).astype(complex),
    )


def _equations(
    data: ResponseData, near: NDArray[np.bool_], centre_hz: float, span: float, inverted: bool
) -> Complexes:
    """Whitened linear equations for the coefficients of the richer polynomial; last, the target.

    Those of each window by themselves, shape (W, k, 7).
    """
    frequency, response = data.frequency_hz[near], data.response[near]
    if inverted:  # d(1/G) = -dG / G^2
        scale, value = response**2, 1 / response
    else:
        scale = ((centre_hz / frequency) ** 2).astype(complex)
        value = response / scale
    columns = np.empty((*frequency.shape, _RICHER + 2), complex)
    columns[..., :-1] = _powers(frequency, centre_hz, span, _RICHER)
    columns[..., -1] = value
    return np.asarray((data.design[near] * scale[:, None, :]) @ columns)


def _powers(frequency_hz: Floats, centre_hz: float, span: float, order: int) -> Floats:
    """Powers 0 to `order` of the scaled frequency, along a new last axis."""
    x = (frequency_hz / centre_hz - 1) / span
    return np.moveaxis(np.stack([x**0, *np.cumprod([x] * order, axis=0)]), 0, -1)
