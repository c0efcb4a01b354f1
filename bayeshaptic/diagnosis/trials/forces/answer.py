"""How forces answer to a hand's motion, and how much further a hand alone would move the device.

Averaged over a motion y, a force on the motor acts as a damper and a spring, N = k_1 s + k_2 with
the numbers that come closest (R. C. Booton, IRE Trans. Circuit Theory 1, 1954), and adds -G N y to
the motion.  Without forces the hand would therefore move the linear mechanism 1 + G N times as far
as it was seen to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.low_pass import slow_share
from bayeshaptic.types import Complexes, Floats

# Lines are read up to so many edges of what is slow, where hardly anything counts as slow any more,
# and no more than so many: two numbers are asked for.
_FAR, _MOST = 2.0, 1000


@dataclass(frozen=True)
class Answer:
    """Reads off what forces add to the motion how they answer to it.

    Attributes
    ----------
    system : LinearSystem
        Without the forces; a batch of one.
    frequency_hz : ndarray, shape (L,)
        Of the lines.
    read : slice
        Lines that are read.
    moved : complex ndarray, shape (R, 2)
        What a damper and a spring of one would add there, with the opposite sign.
    edge_hz : float
        Up to where a motion is slow: `low_pass`.
    """

    system: LinearSystem
    frequency_hz: Floats
    read: slice
    moved: Complexes
    edge_hz: float

    @classmethod
    def of(
        cls, system: LinearSystem, frequency_hz: Floats, position: Complexes, edge_hz: float
    ) -> Answer:
        """For a position at lines, (L,), with the forces in it."""
        last = int(np.searchsorted(frequency_hz, _FAR * edge_hz))
        read = slice(0, last, max(last // _MOST, 1))
        s = np.asarray(2j * np.pi * frequency_hz[read], dtype=complex)
        moved = system.continuous_response(s)[0] * position[read]
        return cls(system, frequency_hz, read, np.stack([s * moved, moved], axis=-1), edge_hz)

    def louder(self, added: Complexes, frequency_hz: Floats) -> Floats:
        """How many times as far a hand would move the motor without forces, shape (W,).

        Parameters
        ----------
        added : complex ndarray, shape (L,)
            What the forces add to the motion at the lines.
        frequency_hz : ndarray, shape (W,)
        """
        answer = self._response(added[None], frequency_hz)[0]
        fast = 1 - slow_share(frequency_hz, self.edge_hz)
        with np.errstate(invalid="ignore"):  # not a number beside parameters that are none
            return np.abs((1 + answer) / (1 + fast * answer))

    def growth(self, added: Complexes | None, slopes: Complexes) -> Floats:
        """Slopes of the logarithm of `louder` at the lines, shape (J, L).

        Parameters
        ----------
        added : complex ndarray, shape (L,), or None
            What the forces add to the motion; None where there are none yet.
        slopes : complex ndarray, shape (J, L)
            And its slopes.
        """
        there = np.zeros_like(slopes[0]) if added is None else added
        answer = self._response(there[None], self.frequency_hz)
        more = self._response(slopes, self.frequency_hz)
        slow = slow_share(self.frequency_hz, self.edge_hz)
        with np.errstate(invalid="ignore"):  # slopes that are no numbers end a fit
            return np.real(slow * more / ((1 + answer) * (1 + (1 - slow) * answer)))

    def _response(self, added: Complexes, frequency_hz: Floats) -> Complexes:
        """G N of what is added at the lines, shape (J, L), at other frequencies; (J, W)."""
        parts = np.concatenate([self.moved.real, self.moved.imag])
        seen = added[:, self.read]
        both = np.concatenate([seen.real, seen.imag], axis=1)
        numbers = -np.linalg.lstsq(parts, both.T, rcond=None)[0]
        s = np.asarray(2j * np.pi * frequency_hz, dtype=complex)
        response = self.system.continuous_response(s)[0]
        return np.asarray((numbers[:1].T * s + numbers[1:].T) * response)
