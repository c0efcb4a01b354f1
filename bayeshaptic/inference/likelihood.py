"""The likelihood of a measurement, given a model: design and formula in docs/statistics.md."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models import Model
from bayeshaptic.models.response.kernels.arrays import RationalArrays, WindowArrays
from bayeshaptic.numerics.spending import spend
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

# What a call costs, and a value of a model with dynamic links, in units of one value of a rational
# model: 0.4 ms, and 0.15 to 0.3 us, where that takes 12 to 25 ns.
_CALL, _LINKED = 2e4, 10.0
_AT_A_TIME = 128  # vectors, of what is done in plain NumPy


@dataclass(frozen=True)
class Likelihood:
    """log p(recording | theta) for batches of parameter vectors in natural values.

    Compiled for every model with finitely many poles, a vector at a time, so that no value depends
    on the batch around it; `plain_deviations` is the same in plain NumPy, and serves the others.

    Attributes
    ----------
    model : Model
    windows : Windows
    """

    model: Model
    windows: Windows

    def __call__(self, theta: Floats) -> Floats:
        """Log likelihood of parameter vectors of shape (B, P); shape (B,)."""
        form = self._rational_form(theta)
        if form is None or self.windows.common is not None:
            return self.pointwise(theta).sum(axis=1)
        from bayeshaptic.models.response.kernels.likelihood import log_likelihood

        spend(_CALL + len(theta) * self.windows.frequency_hz.size)
        value = np.empty(len(theta))
        log_likelihood(form, self._arrays, value)
        return value + np.sum(self.windows.offset)

    def pointwise(self, theta: Floats) -> Floats:
        """Log likelihood of every window, up to a constant of the data; shape (B, W).

        The constant does not depend on the reference that the windows were compressed around.
        """
        left = self.deviations(theta).view(float)
        power = np.einsum("bwk,bwk->bw", left, left)
        left = np.log(self.windows.scatter + power)
        return self.windows.offset - (self.windows.lines - 1) * left

    def deviations(self, theta: Floats) -> Complexes:
        """z - R g(theta): what the model leaves in every window, shape (B, W, r)."""
        return self._deviations(theta, np.ones(len(self.windows.scatter)))

    def normalised(self, theta: Floats) -> Complexes:
        """Deviations over their standard deviation: E|.|^2 = 1 where the model is true."""
        return self._deviations(theta, self._precision)

    def _deviations(self, theta: Floats, weight: Floats) -> Complexes:
        if self.windows.common is not None:
            return self._beside_common(theta, weight)
        return self._plainly(theta, weight)

    def _beside_common(self, theta: Floats, weight: Floats) -> Complexes:
        """`_deviations` less what the windows' common columns make of them, some at a time."""
        out = np.empty((len(theta), *self.windows.target.shape), complex)
        for start in range(0, len(theta), _AT_A_TIME):
            some = slice(start, start + _AT_A_TIME)
            left = self._plainly(theta[some], np.ones_like(weight))
            out[some] = self.windows.without_common(left) * weight[:, None]
        return out

    def _plainly(self, theta: Floats, weight: Floats) -> Complexes:
        form = self._rational_form(theta)
        each = 1.0 if form is not None else _LINKED
        spend(_CALL + each * len(theta) * self.windows.frequency_hz.size)
        if form is None:
            return self.plain_deviations(theta) * weight[:, None]
        from bayeshaptic.models.response.kernels.likelihood import deviations

        out = np.empty((len(theta), *self.windows.target.shape, 2))
        deviations(form, self._arrays, weight, out)
        return out.view(complex)[..., 0]

    def plain_deviations(self, theta: Floats) -> Complexes:
        """`deviations` of any model, in plain NumPy."""
        count, nodes = self.windows.frequency_hz.shape
        frequency_hz = np.ascontiguousarray(self.windows.frequency_hz.ravel())
        out = np.empty((len(theta), *self.windows.target.shape), complex)
        for start in range(0, len(theta), _AT_A_TIME):
            part = theta[start : start + _AT_A_TIME]
            g = self.model.response(part, frequency_hz, measured=True).reshape(
                len(part), count, nodes
            )
            if nodes == 1:
                fitted = self.windows.design[:, :, 0] * g
            else:  # one small matrix product a window, the batch last
                fitted = (self.windows.design @ g.transpose(1, 2, 0)).transpose(2, 0, 1)
            out[start : start + _AT_A_TIME] = self.windows.target - fitted
        return out

    def _rational_form(self, theta: Floats) -> RationalArrays | None:
        """The loops at the windows' nodes; None where they have no finite set of poles."""
        system = self.model.measured_system(theta)
        if not system.has_rational_form or self.model.period_s is None:
            return None
        return system.rational_form(self._node_frequencies, self.model.period_s)

    @cached_property
    def _node_frequencies(self) -> Floats:
        return self._windows_last(self.windows.frequency_hz).ravel()

    @cached_property
    def _arrays(self) -> WindowArrays:
        """The windows as the compiled form reads them."""
        nodes = self.windows.frequency_hz.shape[1]
        design = self._windows_last(self.windows.design[:, :, :nodes])
        target = self._windows_last(self.windows.target)
        scatter = self._windows_last(self.windows.scatter)
        weight = self._windows_last(self.windows.lines - 1.0)
        real = len(self.windows.scatter)
        for array in (design, target, weight):
            array[..., real:] = 0.0
        triangular = (
            design.shape[:2] == (3, 3) and not np.tril(np.moveaxis(design, -1, 0), -1).any()
        )
        return WindowArrays(
            np.ascontiguousarray(design.real),
            np.ascontiguousarray(design.imag),
            np.ascontiguousarray(target.real),
            np.ascontiguousarray(target.imag),
            scatter,
            weight,
            triangular,
        )

    def _windows_last(self, values: NDArray[Any]) -> NDArray[Any]:
        """With the windows last, the first one repeated until vector instructions leave no rest."""
        lanes = 32
        repeated = np.repeat(values[:1], -len(values) % lanes, axis=0)
        return np.ascontiguousarray(np.moveaxis(np.concatenate([values, repeated]), 0, -1))

    @cached_property
    def _precision(self) -> Floats:
        """One over the standard deviation of a window's noise, shape (W,)."""
        return np.asarray(1 / np.sqrt(self.noise_variance))

    @property
    def noise_variance(self) -> Floats:
        """Expected |z - R g|^2 / k of a window where the model is true, shape (W,)."""
        if self.windows.noise is not None:
            return self.windows.noise
        nodes = self.windows.target.shape[1]
        # |z - R g|^2 / k over s0 / (n - k) is an F variable; this is its mean times s0 / (n - k).
        freedom = np.maximum(self.windows.lines - nodes - 1, 0.5)
        return self.windows.scatter / freedom

    def reduced_chi_square(self, theta: Floats) -> Floats:
        """Mean squared normalised deviation a degree of freedom, shape (B,); 1 is the noise.

        Where the noise is what a fit leaves there is no other to compare it with.
        """
        if self.windows.noise is not None:
            return np.ones(len(theta))
        left = self.normalised(theta)
        freedom = left.shape[1] * left.shape[2] - 0.5 * self.model.size
        return np.sum(np.abs(left) ** 2, axis=(1, 2)) / max(freedom, 0.5)
