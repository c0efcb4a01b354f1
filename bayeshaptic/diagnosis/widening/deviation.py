"""How far the measured response is from the model, as a smooth random function of log frequency."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from bayeshaptic.inference.fit import Fit
from bayeshaptic.types import Complexes, Floats

_SIZES = np.geomspace(3e-4, 1.0, 12)
_LENGTHS = (0.05, 0.15, 0.4, 1.2)  # decades
_MANY = 500  # lines, from which on those within so many decades are one
_ONE_PLACE = 0.01


@dataclass(frozen=True)
class Deviation:
    """Relative deviation of the measured response from the model, window by window.

    Attributes
    ----------
    log_f : ndarray, shape (W,)
        Decadic.
    value : complex ndarray, shape (W,)
    variance : ndarray, shape (W,)
        Of its noise.
    """

    log_f: Floats
    value: Complexes
    variance: Floats

    @property
    def jumps(self) -> float:
        """Variance of a part that is another in every window, beside the noise.

        What three neighbours differ from a straight line by.
        """
        order = np.argsort(self.log_f, kind="stable")
        value, variance = self.value[order], self.variance[order]
        apart = np.abs(value[1:-1] - (value[:-2] + value[2:]) / 2) ** 2
        noise = variance[1:-1] + (variance[:-2] + variance[2:]) / 4
        each = 1.5  # what a variance of 1 in every window makes of that difference's: 1 + 2 / 4
        found, rounds = 0.0, 5
        for _ in range(rounds if len(apart) else 0):
            weight = 1 / (noise + each * found) ** 2
            found = max(float(np.average(apart - noise, weights=weight)) / each, 0.0)
        return found


def modelled(fit: Fit) -> Complexes:
    """What the model makes of every window, shape (W, r)."""
    windows = fit.windows
    nodes = windows.frequency_hz
    g = fit.response(nodes)
    return np.einsum("wij,wj->wi", windows.design[:, :, : nodes.shape[1]], g)


def deviation(fit: Fit) -> Deviation:
    """The deviation of a fit."""
    windows = fit.windows
    column = modelled(fit)
    size = np.sum(np.abs(column) ** 2, axis=1)
    noise = np.sqrt(fit.likelihood.noise_variance)[:, None]
    left = fit.residual.reshape(windows.target.shape) * noise
    value = np.sum(column.conj() * left, axis=1) / size
    log_f = np.log10(windows.frequency_hz.mean(axis=1))
    return Deviation(log_f, value, fit.likelihood.noise_variance / size)


def merged(found: Deviation) -> tuple[Deviation, Floats]:
    """The deviation with lines of one place as one, and the means that make it, shape (K, W).

    A periodic recording may have thousands of lines, and what is done with a deviation takes their
    cube.  Over a hundredth of a decade none of the lengths that it may have changes.
    """
    count = len(found.log_f)
    if count < _MANY:
        return found, np.eye(count)
    place = np.floor((found.log_f - found.log_f.min()) / _ONE_PLACE).astype(int)
    kinds, own = np.unique(place, return_inverse=True)
    means = np.zeros((len(kinds), count))
    means[own, np.arange(count)] = 1 / found.variance
    whole = means.sum(axis=1)
    means /= whole[:, None]
    return Deviation(means @ found.log_f, means @ found.value, 1 / whole), means


def matern(distance: Floats, length: float) -> Floats:
    """Correlation of a process that is differentiable once."""
    scaled = np.sqrt(3) * np.abs(distance) / length
    return (1 + scaled) * np.exp(-scaled)


def evidence(
    found: Deviation, slopes: Complexes | None = None
) -> tuple[list[tuple[float, float]], Floats]:
    """Sizes and lengths (decades) that a deviation may have, and the probability of each.

    Parameters
    ----------
    found : Deviation
    slopes : complex ndarray, shape (W, C), optional
        What moves by a standard normal number each, and takes up a part of the deviation.
    """
    taken_up = np.zeros((len(found.log_f), 0)) if slopes is None else slopes
    found, means = merged(found)
    taken_up = means @ taken_up
    between = found.log_f[:, None] - found.log_f[None, :]
    both = np.column_stack([found.value, taken_up])
    cases, logs = [], []
    for length in _LENGTHS:
        shape = matern(between, length)
        for size in _SIZES:
            root = np.linalg.cholesky(size**2 * shape + np.diag(found.variance))
            white = solve_triangular(root, both, lower=True)
            # A complex variable: half of the variance in each part.
            real = np.sqrt(2) * np.concatenate([white.real, white.imag])
            own, given = real[:, 0], real[:, 1:]
            curvature = np.eye(given.shape[1]) + given.T @ given
            along = given.T @ own
            power = own @ own - along @ np.linalg.solve(curvature, along)
            volume = 4 * np.log(np.diag(root)).sum() + np.linalg.slogdet(curvature)[1]
            logs.append(-0.5 * float(power + volume))
            cases.append((float(size), length))
    weight = np.exp(np.array(logs) - max(logs))
    return cases, weight / weight.sum()
