"""The compressed form of a measurement that a likelihood needs: a few model values a window."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Reference = Callable[[NDArray[Any]], NDArray[Any]]
"""A frequency response: frequencies in Hz, shape (L,), to complex values, shape (L,)."""

ALIKE = 1e-10
"""Columns that differ by less count as one: motions of two poles at zero."""


def remembered(reference: Reference) -> Reference:
    """The same response, for several sets of windows in a row: what is known is not asked again."""
    known: dict[bytes, NDArray[Any]] = {}

    def answer(frequency_hz: NDArray[Any]) -> NDArray[Any]:
        points = frequency_hz.tobytes()
        if points not in known:
            known[points] = reference(frequency_hz)
        return known[points]

    return answer


@dataclass(frozen=True, eq=False)
class Windows:
    r"""Windows of neighbouring DFT lines, each compressed to k linear combinations and a scatter.

    With g the model's values at the nodes of a window, and the variance of the window's noise
    integrated out,

    .. math:: \log p(Y \mid \theta) = -\sum_w (n_w - 1) \log\left(s_{0,w} + |z_w - R_w g_w|^2\right)

    Attributes
    ----------
    frequency_hz : ndarray, shape (W, k)
        Nodes where the model is evaluated, Hz; k = 3 for random excitation, 1 otherwise.
    design : complex ndarray, shape (W, r, k + J)
        R; its last J columns are those of further inputs, whose coefficients follow g. r = k + J
        for random excitation, 1 otherwise.
    target : complex ndarray, shape (W, r)
        z.
    scatter : ndarray, shape (W,)
        s0 > 0: what no smooth response explains.
    lines : ndarray, shape (W,)
        n: complex degrees of freedom of target and scatter together.
    noise : ndarray, shape (W,), or None
        Variance of a line's noise as a first fit leaves it; None: as the scatter tells.
    louder : ndarray, shape (W,), or None
        How many times as far a hand would move the device without the forces that were taken off.
    common : complex ndarray, shape (W, r, S), or None
        Columns whose S coefficients are real and the same in all windows: whatever suits `target`
        best. `noise` is known where there are any.
    """

    frequency_hz: NDArray[Any]
    design: NDArray[Any]
    target: NDArray[Any]
    scatter: NDArray[Any]
    lines: NDArray[Any]
    noise: NDArray[Any] | None = None
    louder: NDArray[Any] | None = None
    common: NDArray[Any] | None = None

    @property
    def offset(self) -> NDArray[Any] | float:
        """What is due to `louder` in the log likelihood of each window, shape (W,), or 0.

        What was measured is the motion with the forces in it, whatever they are taken for: its
        density is that of the motion without them times the Jacobian of one over the other.
        """
        return 0.0 if self.louder is None else 2 * (self.lines - 1) * np.log(self.louder)

    @property
    def places_hz(self) -> NDArray[Any]:
        """Where each number of `target` is drawn, shape (W, r): at a node, the rest amid these."""
        nodes = self.frequency_hz
        further = self.target.shape[1] - nodes.shape[1]
        middle = np.repeat(nodes.mean(axis=1, keepdims=True), max(further, 0), axis=1)
        return np.concatenate([nodes, middle], axis=1)

    @property
    def inputs(self) -> int:
        """J, the number of further inputs."""
        return self.design.shape[2] - self.frequency_hz.shape[1]

    def without_common(self, left: NDArray[Any]) -> NDArray[Any]:
        """Deviations less what of them the common columns make, both of shape (B, W, r).

        Coefficients with a flat prior, integrated out: the likelihood is that of the best ones.
        """
        if self.common is None:
            return left
        from bayeshaptic.recordings.response.common_kernel import take_off

        assert self.noise is not None
        sd = np.sqrt(self.noise)[:, None]
        white = np.ascontiguousarray(left / sd).view(float).reshape(len(left), -1)
        directions = self._common_directions
        take_off(directions, np.ascontiguousarray(directions.T), white)
        return np.asarray(white.view(complex).reshape(left.shape) * sd)

    @property
    def common_freedom(self) -> NDArray[Any] | float:
        """Complex lines of each window that the common columns take, shape (W,), or 0."""
        if self.common is None:
            return 0.0
        taken = np.sum(self._common_directions**2, axis=0)
        return np.asarray(0.5 * taken.reshape(len(self.lines), -1).sum(axis=1))

    @cached_property
    def _common_directions(self) -> NDArray[Any]:
        """Orthonormal rows that span the common columns over the noise, as real numbers."""
        assert self.common is not None and self.noise is not None
        white = self.common / np.sqrt(self.noise)[:, None, None]
        columns = np.moveaxis(white, 2, 0).copy().view(float).reshape(white.shape[2], -1)
        columns /= np.linalg.norm(columns, axis=1, keepdims=True)
        _, size, directions = np.linalg.svd(columns, full_matrices=False)
        return np.ascontiguousarray(directions[size > ALIKE * size[0]])

    def part(self, chosen: NDArray[Any]) -> Windows:
        """Some of the windows, by a mask or an index."""
        return Windows(
            self.frequency_hz[chosen],
            self.design[chosen],
            self.target[chosen],
            self.scatter[chosen],
            self.lines[chosen],
            None if self.noise is None else self.noise[chosen],
            None if self.louder is None else self.louder[chosen],
            None if self.common is None else self.common[chosen],
        )

    def after(self, others: Windows) -> Windows:
        """The windows with the lowest ones replaced by `others`.

        Of windows that no model was fitted to.
        """
        count = len(others.lines)
        return self._joined(others, lambda own, other: np.concatenate([other, own[count:]]))

    def where(self, chosen: NDArray[Any], others: Windows) -> Windows:
        """Those chosen by a mask, shape (W,), and in the place of each of the rest another."""

        def either(own: NDArray[Any], other: NDArray[Any]) -> NDArray[Any]:
            mask = chosen.reshape(-1, *[1] * (own.ndim - 1))
            return np.where(mask, own, other)

        return self._joined(others, either)

    def _joined(
        self, others: Windows, join: Callable[[NDArray[Any], NDArray[Any]], NDArray[Any]]
    ) -> Windows:
        names = ("frequency_hz", "design", "target", "scatter", "lines")
        found = (join(getattr(self, name), getattr(others, name)) for name in names)
        return Windows(*found)
