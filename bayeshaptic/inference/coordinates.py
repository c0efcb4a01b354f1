"""The coordinates in which parameters are fitted and sampled.

Positive parameters are known up to a factor and go in as logarithms.  Dampers to the ground may be
zero: they stay linear, with a wall at zero, because every coordinate that pushes the wall away to
infinity mixes badly there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models import Model

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinates:
    """A map between natural values theta and coordinates phi, both of shape (B, P).

    Attributes
    ----------
    log : ndarray of bool, shape (P,)
        Where phi = log(theta); elsewhere phi = theta / scale.
    scale : ndarray, shape (P,)
    low, high : ndarray, shape (P,)
        The support of the priors, in phi.
    """

    log: NDArray[np.bool_]
    scale: Floats
    low: Floats
    high: Floats

    @property
    def walls(self) -> NDArray[np.bool_]:
        """Which parameters have a wall at the low end that the posterior may lean on."""
        return ~self.log & np.isfinite(self.low)

    def natural(self, phi: Floats) -> Floats:
        return np.where(self.log, np.exp(np.where(self.log, phi, 0.0)), phi * self.scale)

    def coordinate(self, theta: Floats) -> Floats:
        positive = np.where(self.log, np.maximum(theta, 1e-300), 1.0)
        return np.where(self.log, np.log(positive), theta / self.scale)

    def log_jacobian(self, phi: Floats) -> Floats:
        """log |d theta / d phi| up to a constant, shape (B,)."""
        return np.sum(np.where(self.log, phi, 0.0), axis=-1)

    def inside(self, phi: Floats) -> NDArray[np.bool_]:
        """Which vectors lie in the support of the priors, shape (B,)."""
        return np.all((phi >= self.low) & (phi <= self.high), axis=-1)


def coordinates(model: Model) -> Coordinates:
    """The coordinates of `model`, whose priors must be set."""
    priors = [model.prior(name) for name in model.names]
    log = np.array([prior.coordinate == "log" for prior in priors])
    spread = np.array([float(p.quantile(0.84) - p.quantile(0.16)) for p in priors])
    scale = np.where(log, 1.0, spread)
    support = np.array([prior.support for prior in priors])
    with np.errstate(divide="ignore"):
        logs = np.where(log[:, None], np.log(np.where(log[:, None], support, 1.0)), 0.0)
    low, high = np.where(log[:, None], logs, support / scale[:, None]).T
    return Coordinates(log, scale, low, high)


def reach(model: Model, prior_sds: float) -> tuple[Floats, Floats]:
    """Lowest and highest natural values that a fit without priors may visit, shape (P,) each.

    They are the priors' quantiles at `prior_sds` standard deviations of a normal variable.
    """
    from scipy.special import ndtr

    tail = float(ndtr(-prior_sds))
    priors = [model.prior(name) for name in model.names]
    low = np.array([p.support[0] if p.coordinate == "linear" else p.quantile(tail) for p in priors])
    low = np.where(np.isfinite(low), low, [float(p.quantile(tail)) for p in priors])
    return low, np.array([float(p.quantile(1 - tail)) for p in priors])
