"""How a virtual wall's damping term gets its velocity from sampled positions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from bayeshaptic.arguments import check_fields
from bayeshaptic.errors import InputError
from bayeshaptic.types import Complexes, Floats


class Damping(Protocol):
    """A velocity estimate v[k] = a v[k-1] + (1 - a) (y[k] - y[k-1]) / T with its smoothing a."""

    @property
    def label(self) -> str:
        """What a figure or a table calls it."""

    @property
    def cutoff_hz(self) -> float | None:
        """The frequency from which the velocity is smoothed, Hz; None without smoothing."""

    def smoothing(self, period_s: float) -> float:
        """The factor a, 0 to below 1, at a sampling period of `period_s` seconds."""


@dataclass(frozen=True)
class Backward:
    """The backward difference, v[k] = (y[k] - y[k-1]) / T."""

    @property
    def label(self) -> str:
        return "backward difference"

    @property
    def cutoff_hz(self) -> None:
        return None

    def smoothing(self, period_s: float) -> float:
        """The factor a, 0 at any `period_s`."""
        return 0.0


@dataclass(frozen=True)
class LowPass:
    """The backward difference behind a first-order low-pass filter.

    v[k] = a v[k-1] + (1 - a) (y[k] - y[k-1]) / T with the filter's pole where the continuous one
    has it, a = exp(-2 pi cutoff T) (matched pole, no further delay).  Whoever smooths with a factor
    a has the cut-off -ln(a) / (2 pi T).

    Attributes
    ----------
    cutoff_hz : float

    Raises
    ------
    InputError
        If the cut-off is not above zero.
    """

    cutoff_hz: float

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.cutoff_hz > 0:
            raise InputError(f"a low-pass cut-off of {self.cutoff_hz} Hz; give one above zero.")

    @property
    def label(self) -> str:
        return f"low-pass at {self.cutoff_hz:.4g} Hz"

    def smoothing(self, period_s: float) -> float:
        """The factor a at a sampling period of `period_s` seconds."""
        return math.exp(-2 * math.pi * self.cutoff_hz * period_s)


def derivative(damping: Damping, theta: Floats, period_s: float) -> Complexes:
    """The velocity estimate as a transfer function, D(z) = (1 - a) (1 - 1/z) / (T (1 - a/z)).

    Parameters
    ----------
    damping : Damping
    theta : ndarray
        Angles of z = e^{j theta}, 2 pi f T.
    period_s : float
        Sampling period T, s.

    Returns
    -------
    ndarray of complex, of the shape of `theta`
        In 1/s; the imaginary part is positive inside (0, pi).
    """
    a = damping.smoothing(period_s)
    sine, cosine = np.sin(0.5 * theta), np.cos(0.5 * theta)
    scale = 2 * (1 - a) / period_s * sine
    rate = np.empty(theta.shape, complex)  # by its parts: a complex exponential takes five sines
    rate.real, rate.imag = scale * sine, scale * cosine
    if a:
        rate /= 1 - a * (cosine - 1j * sine) ** 2
    return rate


def derivative_at_nyquist(damping: Damping, period_s: float) -> float:
    """D(-1), at the Nyquist frequency: a real number, 1/s; 2/T for the backward difference."""
    a = damping.smoothing(period_s)
    return 2 * (1 - a) / (period_s * (1 + a))
