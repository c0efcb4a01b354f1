"""Parameters along a configuration coordinate: a straight line, bends, and scatter.

Coordinates x_r of recording r at the configuration c_r, D of them, each on its own:

    x_rj = m_j + g_j c_r + f_j(c_r) + t_rj,    t_rj ~ N(0, s_j^2),

f_j a Gaussian process with amplitude a_j.  All f_j have the same length over which they bend, and a
Matern 5/2 kernel (C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning",
MIT Press 2006, equation (4.17)).  With Gaussian likelihoods only the a, the s and the length are
left to sample.  Recordings of one configuration are first taken together, which is exact, so that
the work grows with the number of configurations, not of recordings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from bayeshaptic.inference.population.gaussian_likelihood import GaussianLikelihood, Stacked
from bayeshaptic.inference.population.hierarchy import inverse_and_log_det
from bayeshaptic.inference.population.hyperparameters import DEVICE_SPREAD
from bayeshaptic.types import Bools, Floats

# Priors, log-normal: (median, log standard deviation).
AMPLITUDE = (0.05, 1.5)  # of a parameter's logarithm along the coordinate
LENGTH = (1.0, 0.4)  # in ranges of the measured coordinates
SLOPE = 0.3  # standard deviation of a parameter's logarithm, over half of the range
DEVICE_SCATTER = (DEVICE_SPREAD, 1.0)
HAND_SCATTER = (0.1, 1.0)


@dataclass(frozen=True)
class Trend(Stacked):
    """Described recordings along a coordinate.

    Attributes
    ----------
    likelihoods : sequence of GaussianLikelihood
        R of them.
    coordinate : ndarray, shape (R,)
        The configuration c_r of each recording, in any unit.
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
        """From the lowest measured configuration to the highest, in the coordinate's unit."""
        return float(np.ptp(self.coordinate))

    @cached_property
    def places(self) -> Floats:
        """The configurations, each once, shape (C,)."""
        return np.unique(self.coordinate)

    @cached_property
    def members(self) -> Floats:
        """Which recordings are in which configuration, shape (C, R)."""
        return np.equal.outer(self.places, self.coordinate).astype(float)

    def guess(self) -> tuple[Floats, Floats]:
        """Middle and width of the prior of phi (logarithms of a, s and the length); (2 D + 1,)."""
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
            seen = self.seen(phi[sane])
            root = np.linalg.cholesky(self._covariance(phi[sane], seen))
            white = np.linalg.solve(root, seen.mean.reshape(len(root), -1, 1))[..., 0]
            log_det = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
            value[sane] = seen.log_left - log_det - 0.5 * np.sum(white**2, axis=1)
        return value - 0.5 * np.sum(off**2, axis=1)

    def seen(self, phi: Floats) -> Seen:
        """Recordings of one configuration taken together, which is exact.

        Parameters
        ----------
        phi : ndarray, shape (B, 2 D + 1)

        Returns
        -------
        Seen
        """
        scatter = self._read(phi)[1]
        marginal = self.covariance + (scatter**2)[:, None, :, None] * np.eye(len(self.hand))
        weight, log_dets = inverse_and_log_det(marginal)  # (B, R, D, D), (B, R)
        pull = (weight @ self.mean[:, :, None])[..., 0]
        precision = np.einsum("cr,brij->bcij", self.members, weight)
        score = np.einsum("cr,bri->bci", self.members, pull)
        together, own_log_dets = inverse_and_log_det(precision)
        mean = (together @ score[..., None])[..., 0]
        left = np.sum(score * mean, axis=(1, 2)) - np.sum(pull * self.mean, axis=(1, 2))
        left -= log_dets.sum(axis=1) + own_log_dets.sum(axis=1)
        return Seen(mean, together, weight, 0.5 * left)

    def expected(self, phi: Floats) -> tuple[Floats, Floats]:
        """Mean and covariance of every recording's coordinates, given all recordings.

        Parameters
        ----------
        phi : ndarray, shape (2 D + 1,)
            One vector of hyperparameters.

        Returns
        -------
        mean, covariance : ndarray, shape (R, D), (R, D, D)
        """
        size, count = len(self.hand), len(self.places)
        amplitude, scatter, length = self._read(phi[None])
        seen = self.seen(phi[None])
        whole = self._covariance(phi[None], seen)[0]
        prior = self._prior(amplitude, length, self.places, self.places)[0]
        path = (prior @ np.linalg.solve(whole, seen.mean.ravel())).reshape(count, size)
        left = (prior - prior @ np.linalg.solve(whole, prior)).reshape(count, size, count, size)
        means, covariances = [], []
        for r, place in enumerate(np.searchsorted(self.places, self.coordinate)):
            gain = scatter[0, :, None] ** 2 * seen.weight[0, r]
            kept = np.eye(size) - gain
            means.append(path[place] + gain @ (self.mean[r] - path[place]))
            covariances.append(kept @ left[place, :, place] @ kept.T + kept * scatter[0] ** 2)
        return np.stack(means) + self.prior_mean, np.stack(covariances)

    def draw(self, phi: Floats, grid: Floats, rng: np.random.Generator) -> Floats:
        """Draw paths: the coordinates of a device along the configurations.

        The scatter of a path is one draw for all of it: the device of one day.

        Parameters
        ----------
        phi : ndarray, shape (B, 2 D + 1)
            Hyperparameters, one path for each.
        grid : ndarray, shape (G,)
            Configurations, in the unit of `coordinate`.
        rng : numpy.random.Generator

        Returns
        -------
        ndarray, shape (B, G, D)
        """
        amplitude, scatter, length = self._read(phi)
        size, count, places = len(self.hand), len(phi), len(self.places)
        # A path from the prior, corrected by what was seen of it (Matheron's rule).
        both = np.concatenate([self.places, grid])
        kernel = self._kernel(length, both, both) + 1e-10 * np.eye(len(both))
        bend = np.linalg.cholesky(kernel) @ rng.standard_normal((count, len(both), size))
        start, slope = rng.standard_normal((2, count, 1, size))
        line = self.prior_sd * start + SLOPE * self._centred(both)[:, None] * slope
        prior = line + amplitude[:, None] * bend
        seen = self.seen(phi)
        noise = np.linalg.cholesky(seen.covariance) @ rng.standard_normal((count, places, size, 1))
        off = (seen.mean - prior[:, :places] - noise[..., 0]).reshape(count, -1, 1)
        weighed = np.linalg.solve(self._covariance(phi, seen), off)
        across = self._prior(amplitude, length, grid, self.places)
        path = prior[:, places:] + (across @ weighed).reshape(count, len(grid), size)
        return path + (scatter * rng.standard_normal((count, size)))[:, None] + self.prior_mean

    def _read(self, phi: Floats) -> tuple[Floats, Floats, Floats]:
        """Amplitudes a and scatters s, shape (B, D) each, and the length, shape (B,)."""
        size = len(self.hand)
        values = np.exp(phi)
        return values[:, :size], values[:, size : 2 * size], values[:, -1]

    def _covariance(self, phi: Floats, seen: Seen) -> Floats:
        """Of everything seen, one configuration after the other, shape (B, C D, C D)."""
        amplitude, _, length = self._read(phi)
        whole = self._prior(amplitude, length, self.places, self.places)
        size = len(self.hand)
        for place in range(len(self.places)):
            own = slice(place * size, (place + 1) * size)
            whole[:, own, own] += seen.covariance[:, place]
        return whole

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


@dataclass(frozen=True)
class Seen:
    """All recordings of each configuration together, as one Gaussian likelihood of the path there.

    Attributes
    ----------
    mean, covariance : ndarray, shape (B, C, D), (B, C, D, D)
    weight : ndarray, shape (B, R, D, D)
        Of each recording: inverse of its covariance with the scatter.
    log_left : ndarray, shape (B,)
        What the recordings of one configuration say of each other: with it the density of `mean`
        is that of all recordings.
    """

    mean: Floats
    covariance: Floats
    weight: Floats
    log_left: Floats
