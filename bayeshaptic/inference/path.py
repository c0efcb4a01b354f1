"""Parameters along a configuration coordinate: a straight line, bends, and scatter.

Coordinates x_r of recording r at the configuration c_r, D of them, each on its own:

    x_rj = m_j + g_j c_r + f_j(c_r) + t_rj,    t_rj ~ N(0, s_j^2),

f_j a Gaussian process with amplitude a_j.  All f_j have the same length over which they bend, and a
Matern 5/2 kernel (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning",
MIT Press 2006, equation (4.17)).  With Gaussian likelihoods only the a, the s and the length are
left to sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.gaussian_likelihood import GaussianLikelihood
from bayeshaptic.inference.hyperparameters import DEVICE_SPREAD

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

# Priors, log-normal: (median, log standard deviation).
AMPLITUDE = (0.05, 1.5)  # of a parameter's logarithm along the coordinate
LENGTH = (1.0, 0.4)  # in ranges of the measured coordinates
SLOPE = 0.3  # standard deviation of a parameter's logarithm, over half of the range
DEVICE_SCATTER = (DEVICE_SPREAD, 1.0)
HAND_SCATTER = (0.1, 1.0)


@dataclass(frozen=True)
class Path:
    """Described recordings along a coordinate.

    Attributes
    ----------
    likelihoods : sequence of GaussianLikelihood
        R of them.
    coordinate : ndarray, shape (R,)
    hand : ndarray of bool, shape (D,)
        Which parameters are the hand's: they scatter more.
    prior_mean, prior_sd : ndarray, shape (D,)
        Of m.
    """

    likelihoods: Sequence[GaussianLikelihood] = field(repr=False)
    coordinate: Floats
    hand: Bools
    prior_mean: Floats
    prior_sd: Floats

    @cached_property
    def range(self) -> float:
        return float(np.ptp(self.coordinate))

    @cached_property
    def seen(self) -> Floats:
        """Peaks of the likelihoods less the prior's mean, shape (R D,)."""
        return np.concatenate([one.mean - self.prior_mean for one in self.likelihoods])

    @cached_property
    def noise(self) -> Floats:
        """Their covariance, shape (R D, R D)."""
        from scipy.linalg import block_diag

        return np.asarray(block_diag(*[one.covariance for one in self.likelihoods]), float)

    def guess(self) -> tuple[Floats, Floats]:
        """Middle and width of the prior of phi: logarithms of a, s and the length."""
        scatter = np.where(self.hand[:, None], HAND_SCATTER, DEVICE_SCATTER)
        table = np.concatenate([np.tile(AMPLITUDE, (len(self.hand), 1)), scatter, [LENGTH]])
        return np.log(table[:, 0]), table[:, 1]

    def log_density(self, phi: Floats) -> Floats:
        """Log posterior density of phi of shape (B, 2 D + 1), up to a constant; shape (B,)."""
        middle, width = self.guess()
        off = np.clip((phi - middle) / width, -1e3, 1e3)
        value = np.full(len(phi), -np.inf)
        sane = np.all(np.abs(off) < 8.0, axis=1)
        if sane.any():
            root = np.linalg.cholesky(self._covariance(phi[sane]))
            white = np.linalg.solve(root, self.seen[:, None])[..., 0]
            log_det = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
            value[sane] = -log_det - 0.5 * np.sum(white**2, axis=1)
        return value - 0.5 * np.sum(off**2, axis=1)

    def expected(self, phi: Floats) -> Floats:
        """Mean of every recording's coordinates given one vector phi, shape (R, D)."""
        whole = self._covariance(phi[None])[0]
        x = (whole - self.noise) @ np.linalg.solve(whole, self.seen)
        return x.reshape(len(self.likelihoods), -1) + self.prior_mean

    def draw(self, phi: Floats, grid: Floats, rng: np.random.Generator) -> Floats:
        """Coordinates along `grid` (G,), one path for each phi (B, 2 D + 1); shape (B, G, D).

        The scatter of a path is one draw for all of it: the device of one day.
        """
        amplitude, scatter, length = self._read(phi)
        size, count, seen = len(self.hand), len(phi), len(self.coordinate)
        # A path from the prior, corrected by what was seen of it (Matheron's rule).
        both = np.concatenate([self.coordinate, grid])
        kernel = self._kernel(length, both, both) + 1e-10 * np.eye(len(both))
        bend = np.linalg.cholesky(kernel) @ rng.standard_normal((count, len(both), size))
        start, slope = rng.standard_normal((2, count, 1, size))
        line = self.prior_sd * start + SLOPE * self._centred(both)[:, None] * slope
        prior = line + amplitude[:, None] * bend
        day = scatter[:, None] * rng.standard_normal((count, seen, size))
        noise = np.linalg.cholesky(self.noise) @ rng.standard_normal((count, seen * size, 1))
        off = self.seen - (prior[:, :seen] + day).reshape(count, -1) - noise[..., 0]
        weighed = np.linalg.solve(self._covariance(phi), off[..., None])
        across = self._prior(amplitude, length, grid, self.coordinate)
        path = prior[:, seen:] + (across @ weighed).reshape(count, len(grid), size)
        return path + (scatter * rng.standard_normal((count, size)))[:, None] + self.prior_mean

    def _read(self, phi: Floats) -> tuple[Floats, Floats, Floats]:
        size = len(self.hand)
        values = np.exp(phi)
        return values[:, :size], values[:, size : 2 * size], values[:, -1]

    def _covariance(self, phi: Floats) -> Floats:
        """Of everything seen, shape (B, R D, R D)."""
        amplitude, scatter, length = self._read(phi)
        whole = self._prior(amplitude, length, self.coordinate, self.coordinate) + self.noise
        spread = np.tile(scatter**2, (1, len(self.coordinate)))
        return whole + spread[:, :, None] * np.eye(spread.shape[1])

    def _prior(self, amplitude: Floats, length: Floats, one: Floats, other: Floats) -> Floats:
        """Covariance of m + g c + f between two sets of configurations, (B, G D, H D)."""
        kernel = self._kernel(length, one, other)
        line = SLOPE**2 * np.outer(self._centred(one), self._centred(other))
        own = kernel[..., None] * (amplitude**2)[:, None, None, :] + self.prior_sd**2
        own += line[..., None]
        size = len(self.hand)
        full = own[:, :, None, :, :] * np.eye(size)[:, None, :]  # (B, G, D, H, D)
        return full.reshape(len(length), len(one) * size, len(other) * size)

    def _centred(self, coordinate: Floats) -> Floats:
        """From -1 to 1 over the measured range."""
        middle = 0.5 * (self.coordinate.min() + self.coordinate.max())
        return (coordinate - middle) / (0.5 * self.range)

    def _kernel(self, length: Floats, one: Floats, other: Floats) -> Floats:
        """Correlation of f between two sets of configurations, (B, G, H)."""
        gap = np.sqrt(5) * np.abs(one[:, None] - other) / self.range / length[:, None, None]
        return np.asarray((1 + gap + gap**2 / 3) * np.exp(-gap), np.float64)
