"""The response of a loop without a finite set of poles (delayed internal forces, hysteresis)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.stability.responses.grid import LOWEST
from bayeshaptic.stability.responses.response import Response
from bayeshaptic.types import Complexes, Floats, Ints


class EvaluableSystem(Protocol):
    """A batch of B loops of which the response can be evaluated, and nothing else be known."""

    @property
    def batch(self) -> int:
        """B."""

    @property
    def delay_s(self) -> Floats:
        """Loop delay of each, s; shape (B,)."""

    def rows(self, index: Ints) -> Self:
        """Those loops of the batch."""

    def sampled_response(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """G at frequencies (L,), hold and delay included; shape (B, L)."""

    def continuous_approximation(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """P(s) e^{-s (td + T/2)} at frequencies (L,); shape (B, L)."""


@dataclass(frozen=True)
class EvaluatedResponse:
    """A sampled response known by evaluation alone; the search takes a fine grid.

    It is a `Response`, whose attributes and methods are described there.

    Attributes
    ----------
    system : EvaluableSystem
    period_s : float
        Sampling period, s.
    exact : bool
        False: the continuous approximation P(s) e^{-s (td + T/2)}.
    log_points : int
        Points of the grid.
    """

    system: EvaluableSystem
    period_s: float
    exact: bool = True
    log_points: int = 1500

    @property
    def delay(self) -> Floats:
        return self.system.delay_s / self.period_s

    @property
    def features(self) -> Complexes:
        return np.zeros((self.system.batch, 0), complex)

    def at(self, rows: Ints, theta: Floats) -> Complexes:
        if len(rows) > 1 and np.all(theta == theta[0]):
            return self._evaluate(rows, theta[0])
        out = np.empty(theta.shape, complex)
        for row in np.unique(rows):  # one call for all frequencies of one loop
            mine = np.flatnonzero(rows == row)
            response = self._evaluate(np.array([row]), theta[mine].ravel())
            out[mine] = response.reshape(len(mine), -1)
        return out

    def _evaluate(self, rows: Ints, theta: Floats) -> Complexes:
        """Values of rows (M,) at the same angles (k,), shape (M, k)."""
        frequency = theta / (2 * np.pi * self.period_s)
        system = self.system.rows(rows)
        if self.exact:
            return system.sampled_response(frequency, self.period_s)
        return system.continuous_approximation(frequency, self.period_s)

    def at_ends(self) -> tuple[Floats, Floats]:
        return ends(self, self.exact)

    def stable_at_rest(self) -> NDArray[np.bool_]:
        """A loop without poles to look at is taken to be stable by itself; see `held_at_rest`."""
        return held_at_rest(self)


def ends(response: Response, exact: bool) -> tuple[Floats, Floats]:
    """What `Response.at_ends` gives, (B,) each, by looking very close to the ends."""
    every = np.arange(len(response.delay))
    angles = np.broadcast_to([LOWEST, np.pi], (len(every), 2))
    static, nyquist = response.at(every, angles).T
    flat = np.abs(static.imag) < 1e-3 * np.abs(static.real)
    no_frequency = np.full(len(every), np.nan)
    return np.where(flat, static.real, np.inf), nyquist.real if exact else no_frequency


def held_at_rest(response: Response) -> NDArray[np.bool_]:
    """Whether static stiffness is positive, or an integrator's phase above -180 degrees, (B,).

    It is what a mechanism that is stable by itself can still do wrong for K -> 0+: a double
    integrator with a delay, or a negative static stiffness.
    """
    every = np.arange(len(response.delay))
    slow = response.at(every, np.full((len(every), 1), 1e-6))[:, 0]
    above = (slow.real >= 0) | (slow.imag < 0)
    return above & (response.at_ends()[0] > 0)
