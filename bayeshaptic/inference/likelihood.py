"""The likelihood of a measurement, given a model: design and formula in docs/statistics.md."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bayeshaptic.models import Model
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

_CHUNK = 128


@dataclass(frozen=True)
class Likelihood:
    """log p(recording | theta) for batches of parameter vectors in natural values.

    Attributes
    ----------
    model : Model
    windows : Windows
    """

    model: Model
    windows: Windows

    @cached_property
    def _frequencies(self) -> Floats:
        return np.ascontiguousarray(self.windows.frequency_hz.ravel())

    def deviations(self, theta: Floats) -> Complexes:
        """z - R g(theta): what the model leaves in every window, shape (B, W, r)."""
        count, nodes = self.windows.frequency_hz.shape
        out = np.empty((len(theta), *self.windows.target.shape), complex)
        for start in range(0, len(theta), _CHUNK):
            part = theta[start : start + _CHUNK]
            g = self.model.response(part, self._frequencies).reshape(len(part), count, nodes)
            if nodes == 1:
                fitted = self.windows.design[:, :, 0] * g
            else:  # one small matrix product a window, the batch last
                fitted = (self.windows.design @ g.transpose(1, 2, 0)).transpose(2, 0, 1)
            out[start : start + _CHUNK] = self.windows.target - fitted
        return out

    def pointwise(self, theta: Floats) -> Floats:
        """Log likelihood of every window, up to a constant of the data; shape (B, W).

        The constant does not depend on the reference that the windows were compressed around.
        """
        left = self.deviations(theta)
        power = np.einsum("bwk,bwk->bw", left.real, left.real)
        power += np.einsum("bwk,bwk->bw", left.imag, left.imag)
        return -(self.windows.lines - 1) * np.log(self.windows.scatter + power)

    def __call__(self, theta: Floats) -> Floats:
        """Log likelihood of parameter vectors of shape (B, P); shape (B,)."""
        return self.pointwise(theta).sum(axis=1)

    @property
    def noise_variance(self) -> Floats:
        """Expected |z - R g|^2 / k of a window where the model is true, shape (W,)."""
        nodes = self.windows.target.shape[1]
        # |z - R g|^2 / k over s0 / (n - k) is an F variable; this is its mean times s0 / (n - k).
        freedom = np.maximum(self.windows.lines - nodes - 1, 0.5)
        return self.windows.scatter / freedom

    def normalised(self, theta: Floats) -> Complexes:
        """Deviations over their standard deviation: E|.|^2 = 1 where the model is true."""
        return self.deviations(theta) / np.sqrt(self.noise_variance)[:, None]

    def reduced_chi_square(self, theta: Floats) -> Floats:
        """Mean squared normalised deviation a degree of freedom, shape (B,); 1 is the noise."""
        left = self.normalised(theta)
        freedom = left.shape[1] * left.shape[2] - 0.5 * self.model.size
        return np.sum(np.abs(left) ** 2, axis=(1, 2)) / max(freedom, 0.5)
