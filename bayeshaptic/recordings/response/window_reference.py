"""References: what the response is compared with in a window, so that the ratio is a parabola."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.numerics.triangular import back_substituted
from bayeshaptic.recordings.response.local_polynomial import NODES
from bayeshaptic.recordings.response.windows import Windows

_REACH = 2  # neighbours on each side: nodes for five coefficients, three times over
_ROUNDS = 2  # of weights


def unit_mass(frequency_hz: NDArray[Any]) -> NDArray[Any]:
    """The response of 1 kg, 1/s^2: inertia, damper and spring have a parabola as ratio to it."""
    return -1 / (2 * np.pi * np.asarray(frequency_hz)) ** 2 + 0j


@dataclass(frozen=True)
class LocalRational:
    r"""`unit_mass` times a ratio of two parabolas in each window, which can follow a resonance.

    Made from the data alone: in each window

    .. math:: -(2 \pi f)^2 G(f) \approx \frac{b_0 + b_1 x + b_2 x^2}{1 + a_1 x + a_2 x^2},
        \qquad x = (f - f_c) / f_s

    after T. McKelvey and G. Guerin, "Non-parametric frequency response estimation using a local
    rational model", IFAC Proceedings 45(16), 49-54, 2012, fitted to the nodes of five windows.

    Attributes
    ----------
    edges_hz : ndarray, shape (W - 1,)
        Where one window ends and the next begins.
    centre_hz, scale_hz : ndarray, shape (W,)
    numerator, denominator : complex ndarray, shape (W, 3)
        Coefficients of 1, x, x^2.
    """

    edges_hz: NDArray[Any]
    centre_hz: NDArray[Any]
    scale_hz: NDArray[Any]
    numerator: NDArray[Any]
    denominator: NDArray[Any]

    def __call__(self, frequency_hz: NDArray[Any]) -> NDArray[Any]:
        """The reference at frequencies in Hz, any shape."""
        window = np.searchsorted(self.edges_hz, frequency_hz)
        x = (frequency_hz - self.centre_hz[window]) / self.scale_hz[window]
        powers = _powers(x)
        above = np.sum(self.numerator[window] * powers, axis=-1)
        return unit_mass(frequency_hz) * above / np.sum(self.denominator[window] * powers, axis=-1)

    def where(self, better: NDArray[Any]) -> LocalRational:
        """The same in the windows where `better`, shape (W,), is true; elsewhere `unit_mass`."""
        one = np.array([1, 0, 0])
        return LocalRational(
            self.edges_hz,
            self.centre_hz,
            self.scale_hz,
            np.where(better[:, None], self.numerator, one),
            np.where(better[:, None], self.denominator, one),
        )

    def with_poles(self, poles_hz: NDArray[Any]) -> LocalRational:
        """`unit_mass` over a pole, where there is one; shape (W,), Hz, nan where not."""
        here = (poles_hz - self.centre_hz) / self.scale_hz
        one, over = np.array([1, 0, 0]), np.stack([-here, np.ones_like(here), 0 * here], axis=-1)
        there = ~np.isnan(poles_hz)[:, None]
        return LocalRational(
            self.edges_hz,
            self.centre_hz,
            self.scale_hz,
            np.where(there, one, self.numerator),
            np.where(there, over, self.denominator),
        )


def fit_local_rational(windows: Windows) -> LocalRational:
    """Fit the rational reference to the nodes of each window and its neighbours.

    Linearised least squares, its weights renewed with the denominator in each round.

    Parameters
    ----------
    windows : Windows
        Three nodes a window, compressed with `unit_mass` as reference.
    """
    count = len(windows.lines)
    design = windows.design * unit_mass(windows.frequency_hz)[:, None, :]
    inverse = np.linalg.pinv(design, rcond=1e-10)
    ratio = (inverse @ windows.target[..., None])[..., 0]
    freedom = windows.lines[:, None] - 3
    power = np.sum(np.abs(inverse) ** 2, axis=-1) * windows.scatter[:, None] / freedom

    size = min(2 * _REACH + 1, count)
    first = np.clip(np.arange(count) - _REACH, 0, count - size)
    near = first[:, None] + np.arange(size)
    frequency, ratio, sd = (
        values[near].reshape(count, -1)
        for values in (windows.frequency_hz, ratio, np.sqrt(np.maximum(power, 1e-300)))
    )
    centre = windows.frequency_hz[:, 1]
    scale = np.max(np.abs(frequency - centre[:, None]), axis=1)
    powers = _powers((frequency - centre[:, None]) / scale[:, None])
    columns = np.concatenate([powers + 0j, -ratio[..., None] * powers[..., 1:]], axis=-1)
    denominator = np.concatenate([np.ones((count, 1)), np.zeros((count, 2))], axis=1) + 0j
    for _ in range(_ROUNDS):
        weight = 1 / (sd * np.abs(np.einsum("wij,wj->wi", powers, denominator)))
        both = np.concatenate([columns, ratio[..., None]], axis=-1) * weight[..., None]
        triangle = np.asarray(np.linalg.qr(both, mode="r"))
        coefficients = back_substituted(triangle[:, :5, :5], triangle[:, :5, 5])
        denominator[:, 1:] = coefficients[:, 3:]
    half = (windows.frequency_hz[:, 2] - centre) / NODES[2]
    edges = ((centre + half)[:-1] + (centre - half)[1:]) / 2
    fitted = LocalRational(edges, centre, scale, coefficients[:, :3], denominator)
    # Windows without a force say nothing, and zero is no reference.
    return fitted.where(np.any(fitted.numerator != 0, axis=1))


def _powers(x: NDArray[Any]) -> NDArray[Any]:
    return np.stack([np.ones_like(x), x, x**2], axis=-1)
