"""The posterior density in sampling coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Density:
    """log p(phi | data) up to a constant, for batches phi of shape (B, P)."""

    likelihood: Likelihood
    coordinates: Coordinates

    def __call__(self, phi: Floats) -> Floats:
        phi = np.atleast_2d(phi)
        out = np.full(len(phi), -np.inf)
        here = self.coordinates
        own = here.own(phi)
        inside = here.inside(phi, own)
        largest = 600.0  # of a logarithm: further out they overflow
        inside &= ~np.any((np.abs(own) >= largest) & here.log, axis=1)
        if not inside.any():
            return out
        phi, own = phi[inside], own[inside]
        theta = here.natural(phi, own)
        value = self.likelihood.model.log_prior(theta) + here.log_jacobian(phi, own)
        with np.errstate(all="ignore"):  # far-away proposals may overflow: they are refused
            value += self.likelihood(theta)
        out[inside] = np.where(np.isfinite(value), value, -np.inf)
        return out

    def beyond_walls(self, phi: Floats) -> Floats:
        """The density without its walls: each prior goes on beyond its wall as it begins there.

        It serves Laplace's approximation, whose peak may lie behind a wall.  A half-normal goes on
        as its mirror image, a cut-off normal as the normal, and a uniform prior as a constant.  A
        prior that rises ever more steeply towards its wall goes on as its mirror image, too;
        otherwise the peak of the density would be wherever the climb ends.
        """
        phi = np.atleast_2d(phi)
        low = self.coordinates.low
        walls = self.coordinates.walls
        own = self.coordinates.own(phi)
        behind = np.where(walls, np.minimum(own - low, 0.0), 0.0)
        begin = {int(i): self._prior_at_wall(int(i)) for i in np.flatnonzero(behind.any(axis=0))}
        steep = [index for index, (_, bend) in begin.items() if bend > 0]
        inner = phi - behind
        inner[:, steep] -= behind[:, steep]
        wall = np.where(walls, low * self.coordinates.scale, -np.inf)
        theta = np.maximum(self.coordinates.natural(inner), wall)
        value = self.likelihood.model.log_prior(theta) + self.coordinates.log_jacobian(inner)
        for index, (slope, bend) in begin.items():
            if index not in steep:
                value += slope * behind[:, index] + 0.5 * bend * behind[:, index] ** 2
        with np.errstate(all="ignore"):
            value += self.likelihood(self.coordinates.natural(phi))
        return np.where(np.isfinite(value), value, -np.inf)

    def _prior_at_wall(self, index: int) -> tuple[float, float]:
        """First and second derivative of the log prior just inside the wall of one parameter."""
        name = self.likelihood.model.names[index]
        prior = self.likelihood.model.prior(name)
        scale = self.coordinates.scale[index]
        step = 1e-3
        points = (self.coordinates.low[index] + step * np.arange(3)) * scale
        f = prior.log_density(points)
        bend = float((f[2] - 2 * f[1] + f[0]) / step**2)
        return float((f[1] - f[0]) / step - 0.5 * step * bend), bend
