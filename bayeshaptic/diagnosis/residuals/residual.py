"""The residual in frequency: is it noise, and if not, where does it sit?

All tests look at the windows of the likelihood around a fit.  A window's deviation z - R g has
twice as many real degrees of freedom as nodes, and its scatter s0 tells the noise, so that every
statistic has a known distribution where the model is true.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtri, ndtri_exp

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import Fit, weighted_residuals
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.types import Complexes, Floats

_KNOTS = 16  # of a smooth effect over log frequency


@dataclass(frozen=True)
class ForceSeen:
    """A force that a test looked for, a shape of a motion over its rms.

    Attributes
    ----------
    strength, sd : float
        In the unit of force.
    rms : float
        Of the motion.
    moves : tuple of float
        How far a unit of it, in the model, moves the fitted parameters' coordinates; empty where
        nobody asked.
    """

    strength: float
    sd: float
    rms: float
    moves: tuple[float, ...] = ()


@dataclass(frozen=True)
class Test:
    """One test of the residual.

    Attributes
    ----------
    name : str
    family : str
        The class of effects that raises it: "linear", "nonlinear", "time-varying", "measurement".
    statistic, threshold : float
        Flagged where the statistic exceeds the threshold; clean recordings stay well below.
    frequency_hz : float or None
        Where it is largest.
    text : str
        What was found, in words.
    force : ForceSeen or None
        What a test for a force found.
    usual : float or None
        The threshold before something was taken off the recording, where it is another.
    """

    name: str
    family: str
    statistic: float
    threshold: float
    frequency_hz: float | None
    text: str
    force: ForceSeen | None = None
    usual: float | None = None

    @property
    def flagged(self) -> bool:
        return self.statistic > self.threshold

    @property
    def noticed(self) -> bool:
        """Whether it would be flagged without an allowance for what was taken off."""
        return self.statistic > (self.threshold if self.usual is None else self.usual)

    @property
    def excess(self) -> float:
        """Statistic over threshold."""
        return self.statistic / self.threshold


def frequency_tests(fit: Fit) -> tuple[Test, ...]:
    """The tests of the residual over frequency: in bands, in total, and against smooth changes."""
    return (_band_test(fit), _total_test(fit), _smooth_test(fit))


def window_scores(fit: Fit) -> Floats:
    """Each window's squared deviation as a standard normal score, shape (W,)."""
    windows = fit.windows
    nodes = windows.target.shape[1]
    left = fit.residual.reshape(windows.target.shape)
    freedom = np.maximum(windows.lines - nodes, 1.0)
    # fit.residual is scaled to the mean of the F variable; undo that.
    mean = freedom / np.maximum(freedom - 1, 0.5)
    ratio = mean * np.mean(np.abs(left) ** 2, axis=1)
    with np.errstate(divide="ignore"):  # beyond what a float holds
        return -_upper_score(np.log(fdtrc(2 * nodes, 2 * freedom, ratio)))


def _upper_score(log_p: Floats) -> Floats:
    """The normal quantile with the given log upper tail probability, with its sign turned."""
    return np.asarray(ndtri_exp(np.clip(log_p, -1e5, -1e-12)))


def _band_test(fit: Fit) -> Test:
    scores = window_scores(fit)
    centre = np.log10(fit.windows.frequency_hz.mean(axis=1))
    band_decades = 0.15
    band = np.floor((centre - centre[0]) / band_decades).astype(int)
    worst, where = -np.inf, 0.0
    bands = np.unique(band)
    for index in bands:
        inside = band == index
        z = scores[inside].sum() / np.sqrt(inside.sum())
        if z > worst:
            worst, where = float(z), float(10 ** centre[inside].mean())
    text = f"the residual around {where:.3g} Hz is {worst:.1f} standard deviations above noise"
    return Test("bands", "linear", worst, thresholds.normal(len(bands)), where, text)


def _total_test(fit: Fit) -> Test:
    scores = window_scores(fit)
    z = float(scores.sum() / np.sqrt(len(scores)))
    text = f"over all frequencies the residual is {z:.1f} standard deviations above noise"
    return Test("total", "linear", z, thresholds.normal(), None, text)


def _smooth_test(fit: Fit) -> Test:
    """Would a smooth relative change of the response explain the residual better than noise would?

    The score of G (1 + delta), delta complex and piecewise linear on knots over log frequency,
    with what the model's own parameters can do projected out.
    """
    columns, residual, centres = smooth_columns(fit)
    found = columns.T @ residual
    z = chi_square_score(float(found @ found), columns.shape[1])
    strongest = int(np.argmax(np.abs(columns) @ np.abs(found)))
    where = float(centres[strongest])
    text = f"a smooth change of the response would explain it ({z:.1f} standard deviations)"
    return Test("smooth change", "linear", z, thresholds.SMOOTH, where, text)


def smooth_columns(fit: Fit) -> tuple[Floats, Floats, Floats]:
    """An orthonormal basis of smooth changes that the parameters cannot make.

    Returns
    -------
    columns : ndarray, shape (N, C)
    residual : ndarray, shape (N,)
        Real, of unit variance where the model is true.
    frequency_hz : ndarray, shape (N,)
        Of every row.
    """
    windows = fit.windows
    own, residual = beside_parameters(fit)
    g = fit.response(windows.frequency_hz)
    log_f = np.log10(windows.frequency_hz)
    knots = np.linspace(log_f.min(), log_f.max(), _KNOTS)
    effect = windows.design @ (g[..., None] * hats(log_f, knots))  # (W, k, knots)
    stacked = as_rows(fit, np.concatenate([effect, 1j * effect], axis=-1))
    stacked = stacked - own @ (own.T @ stacked)
    basis, sizes, _ = np.linalg.svd(stacked, full_matrices=False)
    basis = basis[:, sizes > 1e-6 * sizes[0]]
    rows = np.repeat(windows.frequency_hz.ravel(), 2)
    return basis, residual, rows


def hats(at: Floats, knots: Floats) -> Floats:
    """What each knot's value is multiplied by where a line is piecewise straight, (..., K)."""
    return np.stack([np.interp(at, knots, row) for row in np.eye(len(knots))], axis=-1)


def beside_parameters(fit: Fit) -> tuple[Floats, Floats]:
    """An orthonormal basis of what the parameters can do, (N, P), and the residual, (N,)."""
    here = coordinates(fit.model)
    residuals = weighted_residuals(fit.likelihood, here)
    phi = here.coordinate(fit.theta[None])
    residual = residuals(phi)
    return np.linalg.qr(jacobian(residuals, phi, residual)[0])[0], residual[0]


def as_rows(fit: Fit, effect: Complexes) -> Floats:
    """Changes of the windows' targets, (W, k, C), over the noise: real, as the residual, (N, C)."""
    scale = np.sqrt(2 / fit.likelihood.noise_variance)[:, None, None]
    weighed = (scale * effect).reshape(-1, effect.shape[-1])
    # Real and imaginary parts in turn, as `weighted_residuals` has them.
    return np.stack([weighed.real, weighed.imag], axis=1).reshape(2 * len(weighed), -1)


def chi_square_score(value: float, freedom: int) -> float:
    """A chi-square value as a standard normal score."""
    chance = chdtrc(freedom, value)
    if value < 1400 and chance < 1:
        return float(-ndtri(chance))
    return float(np.sqrt(2 * value) - np.sqrt(2 * freedom - 1))
