"""One recording's likelihood as a Gaussian function of the parameters, fitted where it matters.

Between the recordings of a study everything is Gaussian (logarithms of a hand's parameters over
people, small differences of one device), so that with Gaussian likelihoods the levels below the
population can be integrated in closed form.  A likelihood is described by a quadratic function
fitted to its logarithm over a cloud of points: not by the moments of the posterior, which would
carry the prior along and know nothing of dampers that cannot be negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.types import Floats

_MOST_POINTS = 5000  # that a description looks at
STEP = 0.05  # of a derivative, in posterior standard deviations
# Least curvature in units of these, and of a cloud: where the data say nothing, or a ridge is bent.
# What is left of a recording by all others may be much narrower than what its own likelihood says.
_LEAST, _LEAST_OF_CLOUD, _LEAST_OF_REST = 1e-3, 0.3, 0.02


@dataclass(frozen=True)
class GaussianLikelihood:
    """log p(recording | x) = constant - (x - mean) precision (x - mean) / 2.

    Attributes
    ----------
    mean : ndarray, shape (D,)
        The peak, in the coordinates of the study.
    precision, covariance : ndarray, shape (D, D)
        Curvature of the logarithm at the peak, and its inverse.
    constant : float
        Log likelihood at the peak.
    """

    mean: Floats
    precision: Floats
    covariance: Floats
    constant: float

    def __call__(self, x: Floats) -> Floats:
        """Log likelihood of points of shape (B, D); shape (B,)."""
        off = x - self.mean
        return self.constant - 0.5 * np.einsum("bi,ij,bj->b", off, self.precision, off)


class Stacked:
    """Likelihoods of R recordings, as arrays over them."""

    likelihoods: Sequence[GaussianLikelihood]
    prior_mean: Floats

    @cached_property
    def mean(self) -> Floats:
        """Their peaks, less the prior's mean; shape (R, D)."""
        return np.stack([one.mean for one in self.likelihoods]) - self.prior_mean

    @cached_property
    def covariance(self) -> Floats:
        """Their covariances V_r, shape (R, D, D)."""
        return np.stack([one.covariance for one in self.likelihoods])


def gaussian_likelihood(posterior: Posterior, here: Coordinates) -> GaussianLikelihood:
    """The likelihood of a recording, described over the draws of its own posterior.

    Parameters
    ----------
    posterior : Posterior
        Of the recording.  Of many draws 5,000 are looked at.
    here : Coordinates
        The coordinates of the study.

    Returns
    -------
    GaussianLikelihood
    """
    every = -(-len(posterior.draws) // _MOST_POINTS)
    x = here.coordinate(posterior.draws[::every])
    return fit_quadratic(x, posterior.log_likelihood.ravel()[::every])


def described(posterior: Posterior, here: Coordinates, draws: Floats) -> GaussianLikelihood | None:
    """The likelihood of a recording, described where a whole study says that its parameters are.

    Its own logarithm is fitted, and nothing divided by what the other recordings say: that is a
    mixture over few draws of the hyperparameters, and its errors would be those of the description.

    Parameters
    ----------
    posterior : Posterior
        Of the recording.
    here : Coordinates
        The coordinates of the study.
    draws : ndarray, shape (n, P)
        Of its parameters given all recordings, natural values in any order; as many are looked at
        as of its own.

    Returns
    -------
    GaussianLikelihood or None
        None without the measurement, and where the model cannot be evaluated.
    """
    x = here.coordinate(draws[:_MOST_POINTS])
    value = exact_likelihood(posterior, here, x)
    if value is None or not np.isfinite(value).all():
        return None
    return fit_quadratic(x, value, _LEAST_OF_REST)


def exact_likelihood(posterior: Posterior, here: Coordinates, x: Floats) -> Floats | None:
    """Log likelihood of a recording by its model, without any description.

    Parameters
    ----------
    posterior : Posterior
        Of the recording.
    here : Coordinates
        The coordinates of the study.
    x : ndarray, shape (B, D)
        Points in these coordinates.

    Returns
    -------
    ndarray, shape (B,), or None
        -inf where the model cannot be evaluated; None where the posterior was saved without its
        measurement.
    """
    if posterior.windows is None:
        return None
    with np.errstate(all="ignore"):  # far-away points may overflow: they are refused
        value = Likelihood(posterior.model, posterior.windows)(here.natural(x))
    return np.where(np.isfinite(value), value, -np.inf)


def linearised(
    posterior: Posterior, here: Coordinates, x: Floats, step: Floats
) -> GaussianLikelihood | None:
    """The likelihood around one point, with the model linear there.

    Each window's curvature is exact but for second derivatives of the model, and never negative
    (Gauss-Newton for the likelihood of docs/statistics.md, whose noise is integrated out).

    Parameters
    ----------
    posterior : Posterior
        Of the recording.
    here : Coordinates
        The coordinates of the study.
    x, step : ndarray, shape (D,)
        Where, and how far to go to either side for the derivatives.

    Returns
    -------
    GaussianLikelihood or None
        None without the measurement, and where the model cannot be evaluated.
    """
    if posterior.windows is None:
        return None
    windows = posterior.windows
    around = np.concatenate([x[None], x + np.diag(step), x - np.diag(step)])
    with np.errstate(all="ignore"):
        left = Likelihood(posterior.model, windows).deviations(here.natural(around))
    if not np.isfinite(left).all():
        return None
    size = len(x)
    slopes = (left[1 : size + 1] - left[size + 1 :]) / (2 * step[:, None, None])
    rows = np.concatenate([slopes.real, slopes.imag], axis=2)  # (D, W, 2 k)
    middle = np.concatenate([left[0].real, left[0].imag], axis=1)
    power = np.sum(middle**2, axis=1)
    total = windows.scatter + power
    weight = 2 * (windows.lines - 1) / total
    along = np.einsum("wk,dwk->dw", middle, rows)
    gradient = -along @ weight
    curvature = np.einsum("dwk,ewk,w->de", rows, rows, weight, optimize=True)
    # The logarithm bends the other way along the deviation itself.
    back = np.minimum(2 / total, 1 / np.maximum(power, 1e-300))
    curvature -= (along * (weight * back)) @ along.T
    value = float(-np.sum((windows.lines - 1) * np.log(total)))
    return at_peak(x, gradient, curvature, value, step / STEP, _LEAST)


def fit_quadratic(
    x: Floats, log_likelihood: Floats, least: float = _LEAST_OF_CLOUD
) -> GaussianLikelihood:
    """Fit a quadratic function to a log likelihood over a cloud of points, by least squares.

    Directions in which the log likelihood does not fall off get next to no curvature, so that the
    description is a (very wide) distribution.

    Parameters
    ----------
    x : ndarray, shape (B, D)
        The points.
    log_likelihood : ndarray, shape (B,)
        The log likelihood at each.
    least : float
        The least curvature that a direction may have, in units of the cloud's.

    Returns
    -------
    GaussianLikelihood
    """
    middle = x.mean(axis=0)
    values, vectors = np.linalg.eigh(np.cov(x.T))
    width = np.sqrt(np.maximum(values, 1e-12 * values.max()))
    v = (x - middle) @ (vectors / width)
    first, second = np.triu_indices(x.shape[1])
    terms = np.column_stack([np.ones(len(v)), v, v[:, first] * v[:, second]])
    level = log_likelihood.mean()
    found = np.linalg.lstsq(terms, log_likelihood - level, rcond=None)[0]
    size = x.shape[1]
    curvature = np.zeros((size, size))
    curvature[first, second] = -found[size + 1 :]
    curvature = curvature + curvature.T
    slope = found[1 : size + 1]
    value = float(level + found[0])
    own = at_peak(np.zeros(size), slope, curvature, value, np.ones(size), least)
    out, back = vectors / width, (vectors * width).T
    return GaussianLikelihood(
        middle + own.mean @ back,
        out @ own.precision @ out.T,
        back.T @ own.covariance @ back,
        own.constant,
    )


def at_peak(
    x: Floats, gradient: Floats, curvature: Floats, value: float, unit: Floats, least: float
) -> GaussianLikelihood:
    """A quadratic function that is known around `x`, written around its peak.

    Parameters
    ----------
    x, gradient : ndarray, shape (D,)
        A point, and the slope there.
    curvature : ndarray, shape (D, D)
        Negative second derivatives.
    value : float
        The function at `x`.
    unit : ndarray, shape (D,)
        Units of the coordinates in which `least` is meant.
    least : float
        The least curvature that a direction may have; what bends less, or the other way, gets it.

    Returns
    -------
    GaussianLikelihood
    """
    bends, axes = np.linalg.eigh(curvature * np.outer(unit, unit))
    bends = np.maximum(bends, least)
    slope = axes.T @ (gradient * unit)
    out, back = axes / unit[:, None], axes * unit[:, None]
    return GaussianLikelihood(
        x + back @ (slope / bends),
        (out * bends) @ out.T,
        (back / bends) @ back.T,
        float(value + 0.5 * np.sum(slope**2 / bends)),
    )
