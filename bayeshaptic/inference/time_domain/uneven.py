"""A force that changes along the way, in each direction: how large it is, from the data."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.types import Floats

WAVES = 12  # half waves along the way, a direction
_OPEN = 1e-12  # of a column's power: the share of a prior that is none
_LENGTHS = (1.0, 3.0, 8.0)  # waves from which they are smaller
_SIZES = (1e-5, 1e-4, 1e-3, 3e-3, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3, 0.6)  # of the command's rms


@dataclass(frozen=True)
class Way:
    """Where a recording has been.

    Attributes
    ----------
    low, high : float
        Of its positions.
    means : ndarray, shape (WAVES,)
        Of the half waves, over the samples at which it moves.
    """

    low: float
    high: float
    means: Floats = field(repr=False)

    @classmethod
    def of(cls, position: Floats) -> Way:
        low, high = float(position.min()), float(position.max())
        moves = np.diff(position, append=position[-1]) != 0
        return cls(low, high, _half_waves(position[moves], low, high).mean(axis=1))


def waves(position: Floats, way: Way) -> Floats:
    """cos(pi j s) less its mean, j from 1, over the share s of the way; shape (WAVES, N).

    Over the samples at which it moved, what a force along it is on average is in the constant
    force and the dry friction alone.  Means over the way itself are another matter: how much of a
    slow wave lies in those depends on where the way happens to begin and to end.
    """
    return np.asarray(_half_waves(position, way.low, way.high) - way.means[:, None])


def _half_waves(position: Floats, low: float, high: float) -> Floats:
    share = np.clip((position - low) / (high - low), 0.0, 1.0)
    return np.asarray(np.cos(np.pi * np.arange(1, WAVES + 1)[:, None] * share))


@dataclass(frozen=True)
class Ridge:
    """A linear fit in which some columns have normal priors.

    Attributes
    ----------
    solution : ndarray, shape (C,)
    inverse : ndarray, shape (C, C)
        Of columns' column + the priors' share.
    share : ndarray, shape (C,)
        That share: noise variance over prior variance; next to nothing without a prior.
    prior : ndarray, shape (C,)
        Prior variances; as good as infinite without a prior.
    used : float
        Effective number of columns.
    """

    solution: Floats
    inverse: Floats
    share: Floats
    prior: Floats
    used: float


def ridge(
    columns: Floats,
    target: Floats,
    plain: int,
    size: float,
    effective: float,
    reach: Floats | None = None,
) -> Ridge:
    """Fit `target`, with prior variances by the largest marginal likelihood.

    Parameters
    ----------
    columns : ndarray, shape (N, C)
        The first `plain` have no prior, the others are `waves` forward and then backward.
    target : ndarray, shape (N,)
    plain : int
    size : float
        Of the command, which the priors are scaled by.
    effective : float
        Number of independent samples that the N are worth.
    reach : ndarray, shape (plain,), optional
        How far the first may go (prior standard deviations) where nothing holds them.
    """
    gram, along = columns.T @ columns, columns.T @ target
    scale = np.sqrt(np.diag(gram))
    scale[scale == 0] = 1.0
    gram, along = gram / np.outer(scale, scale), along / scale
    found = _Evidence(gram, along, scale, plain, float(target @ target), len(target), effective)
    order = np.tile(np.arange(1, WAVES + 1), 2)
    best, prior, noise = -np.inf, np.zeros(0), 0.0
    for length in _LENGTHS:
        shape = 1 / (1 + (order / length) ** 2)
        shape *= 2 / shape.sum()
        for share in _SIZES:
            variances = (share * size) ** 2 * shape
            evidence, at_best = found(variances)
            if evidence > best:
                best, prior, noise = evidence, variances, at_best
    # What a recording leaves open (friction beside a constant force, where nothing turns) is open.
    weight = _OPEN * scale**2
    if reach is not None:
        weight[:plain] = np.maximum(weight[:plain], found.thin * noise / reach**2)
    variances = np.append(found.thin * noise / weight[:plain], prior)
    weight[plain:] += found.thin * noise / prior
    inverse = np.linalg.inv(gram + np.diag(weight / scale**2))
    used = float(np.trace(inverse @ gram))
    solution = inverse @ along / scale
    return Ridge(solution, inverse / np.outer(scale, scale), weight, variances, used)


@dataclass(frozen=True)
class _Evidence:
    """Marginal likelihood of prior variances, the noise at its best."""

    gram: Floats
    along: Floats
    scale: Floats
    plain: int
    power: float
    samples: int
    effective: float

    @property
    def thin(self) -> float:
        return self.samples / self.effective

    def __call__(self, prior: Floats) -> tuple[float, float]:
        """Log evidence up to a constant, and the noise variance."""
        weight = np.zeros(len(self.scale))
        noise = 0.1 * self.power / self.samples
        freedom = max(float(self.effective) - self.plain, 1.0)
        rounds = 15
        for _ in range(rounds):
            weight[self.plain :] = self.thin * noise / prior
            full = self.gram + np.diag(weight / self.scale**2 + _OPEN)
            left = self.power - float(self.along @ np.linalg.solve(full, self.along))
            new = max(left, 1e-12 * self.power) / self.samples * self.effective / freedom
            settled = abs(new / noise - 1) < 1e-3
            noise = new
            if settled:
                break
        weight[self.plain :] = 1 / prior
        full = self.gram / (self.thin * noise) + np.diag(weight / self.scale**2)
        full += 1e-16 * np.eye(len(full))
        determinant = np.linalg.slogdet(full)[1] + np.log(prior).sum()
        return float(-0.5 * self.effective * np.log(noise) - 0.5 * determinant), float(noise)
