"""The motion that neither the command nor forces make: a hand's, or a free device's drift.

It is read off the encoder: what is measured, less what command and forces do.  Forces act in it,
so that what they do and it must be found together.  One read off beside what forces did in the
last motion, over and over, comes to that by as little a step as friction is more of the damping
than the damper: friction that was nearly all of it lay 12 mm apart from a motion of 0.5 mm, and a
tenth less of it seemed to fit better.  Newton's steps are as large as is needed; how forces answer
is told by the linear parameters that fit where no force is taken off, since these are the
mechanism's with what forces do on the average (R. C. Booton, IRE Trans. Circuit Theory 1, 1954).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.linalg import lstsq
from scipy.fft import next_fast_len
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.models.response.motion import linear_motion
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.types import Floats

_HAND_HZ = 20.0
_ORDER = 2
# Root mean square of velocities off, as a share of the motion's, and how many simulations at most.
# Log likelihoods of 2,500 to 9,200 are then right to 2.
_SETTLED, _MOST = 3e-4, 8
_ALIKE = 1e-14  # squares: motions that differ by a ten-millionth are one


class Besides(Protocol):
    """What the encoder tells of a motion that nothing known makes."""

    def of(self, left: Floats) -> Floats:
        """That motion in what is left of the measured position, shapes (N,)."""
        ...

    def step(self, off: Floats) -> Floats:
        """How far to go where `of` what is left differs from what was taken by so much."""
        ...

    def answered(self, motion: Floats) -> Floats:
        """What a further motion comes to when this motion answers to it, and forces to that."""
        ...


@dataclass(frozen=True)
class Hand:
    """A hand's: what is slow, because there the encoder sees it well.

    Attributes
    ----------
    period_s : float
    response, usual : LinearSystem
        The mechanism without forces, and that with what they do on the average; batches of one.
    """

    period_s: float
    response: LinearSystem
    usual: LinearSystem

    def of(self, left: Floats) -> Floats:
        rate = 1 / self.period_s
        low = butter(_ORDER, self._edge_hz(), fs=rate, output="sos")
        return np.asarray(sosfiltfilt(low, left))

    def step(self, off: Floats) -> Floats:
        return self.answered(off)

    def answered(self, motion: Floats) -> Floats:
        count = next_fast_len(len(motion), real=True)
        spectrum = np.fft.rfft(motion, count)
        far = 10.0  # edges, where a ten-thousandth of the motion counts as slow
        frequency_hz = np.fft.rfftfreq(count, self.period_s)[: len(spectrum)]
        frequency_hz = frequency_hz[frequency_hz < far * self._edge_hz()]
        frequency_hz[0] = frequency_hz[1]  # where a hand only damps there is no response at rest
        slow = 1 / (1 + (frequency_hz / self._edge_hz()) ** (2 * _ORDER))
        s = np.asarray(2j * np.pi * frequency_hz, dtype=complex)
        ratio = self.usual.continuous_response(s)[0] / self.response.continuous_response(s)[0]
        spectrum[: len(s)] /= 1 + slow * (ratio - 1)
        return np.fft.irfft(spectrum, count)[: len(motion)]

    def _edge_hz(self) -> float:
        return min(_HAND_HZ, 0.4 / self.period_s)


@dataclass(frozen=True)
class Drift:
    """A free device's: how it began to move, and a constant force.

    Attributes
    ----------
    own, usual : ndarray, shape (N, 3)
        Motions of standing still, a constant force and a push, of the mechanism without forces and
        of that with what they do on the average; each of size one.
    size : ndarray, shape (3,)
        Sizes of `own` over those of `usual`.
    """

    own: Floats
    usual: Floats
    size: Floats

    def of(self, left: Floats) -> Floats:
        return np.asarray(self.own @ _parts(self.own, left))

    def step(self, off: Floats) -> Floats:
        return np.asarray(self.own @ self._answer(off))

    def answered(self, motion: Floats) -> Floats:
        answer = self._answer(motion)
        return np.asarray(motion - self.usual @ (answer / self.size) + self.own @ answer)

    def _answer(self, motion: Floats) -> Floats:
        return self.size * _parts(self.usual, motion)


@dataclass(frozen=True)
class Nothing:
    """Where forces do not know of it."""

    def of(self, left: Floats) -> Floats:
        return np.zeros_like(left)

    def step(self, off: Floats) -> Floats:
        return off

    def answered(self, motion: Floats) -> Floats:
        return motion


def drift_of(system: LinearSystem, usual: LinearSystem, samples: int, period_s: float) -> Drift:
    """A free device's drift: see `Drift`."""
    steady = np.ones(samples)

    def motions(of: LinearSystem) -> Floats:
        return np.stack([steady, *linear_motion(of, steady, period_s)], axis=1)

    own, other = motions(system), motions(usual)
    sizes, others = np.linalg.norm(own, axis=0), np.linalg.norm(other, axis=0)
    return Drift(own / sizes, other / others, sizes / others)


def settled(
    besides: Besides, left: Floats, forced: Callable[[Floats], Floats], expected: Floats
) -> Floats:
    """What forces add to the motion, in one that agrees with the measured one.

    Parameters
    ----------
    besides : Besides
    left : ndarray, shape (N,)
        The measured position less what the command does.
    forced : callable
        From the motion that nothing known makes to what each force adds, shape (F, N); nan where
        it runs away.
    expected : ndarray, shape (N,)
        What forces may be expected to add together, to begin with.

    Returns
    -------
    ndarray, shape (F, N)
        The best that was found, where none agrees: a motion that sticks, or is chaotic, answers
        unlike the average.
    """
    taken = besides.of(left - expected)
    best, least = forced(taken), np.inf
    added = best
    for _ in range(_MOST - 1):
        total = added.sum(axis=0)
        if not np.isfinite(total[-1]):
            break
        off = besides.of(left - total) - taken
        wrong = float(np.diff(off).std())
        if wrong < least:
            best, least = added, wrong
        # Measured, but without the encoder's steps.
        if wrong <= _SETTLED * np.diff(taken + total).std() or wrong > least:
            break
        taken = taken + besides.step(off)
        added = forced(taken)
    return best


def one_step(
    besides: Besides, left: Floats, forced: Callable[[Floats], Floats], near: Floats
) -> Floats:
    """What each force adds, to first order in how that differs from `near`, shapes (F, N)."""
    further = forced(besides.of(left - near.sum(axis=0))) - near
    return near + np.array([besides.answered(one) for one in further])


def _parts(columns: Floats, motion: Floats) -> Floats:
    """How much of each column, of size one, a motion has."""
    return np.asarray(lstsq(columns.T @ columns, columns.T @ motion, rcond=_ALIKE)[0])
