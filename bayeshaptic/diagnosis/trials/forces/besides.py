"""The motion that neither the command nor forces make: a hand's, or a free device's coasting.

It is read off the encoder as what is measured, less what command and forces do.  Forces act in this
motion as well, so that both must be found together.  Reading one off beside the other in turn
converges slowly where friction is most of the damping: friction that was nearly all of it ended 12
mm away from a motion of 0.5 mm, and a tenth less of it seemed to fit better.  How forces answer to
a change of the motion is told by the linear parameters that fit where no force is taken off,
because these contain what forces do on average (R. C. Booton, IRE Trans. Circuit Theory 1, 1954).
With them Newton's steps have the right length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.linalg import lstsq
from scipy.fft import next_fast_len

from bayeshaptic.diagnosis.residuals.unforced import parts
from bayeshaptic.diagnosis.trials.forces.at_rest import AtRest
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.low_pass import low_pass, slow_share
from bayeshaptic.types import Floats

# Root mean square of what is off, as a share of all that is left, and how many simulations at most.
_SETTLED, _MOST = 0.1, 8
_MIXED = 5  # motions that a mixture has at most
_WORSE = 3  # in turn, after which none is better any more


class Besides(Protocol):
    """What the encoder tells of the motion that neither command nor forces make."""

    def begin(self, left: Floats) -> Floats:
        """Where to begin, before anything is known of forces; shapes (N,)."""
        ...

    def of(self, left: Floats) -> Floats:
        """That motion in what is left of the measured position, shapes (N,)."""
        ...

    def off(self, taken: Floats, rest: Floats) -> Floats:
        """How far all of the motion is off where `taken` leaves that `rest`."""
        ...

    def step(self, off: Floats) -> Floats:
        """How far to go, where forces answer to it."""
        ...

    def answered(self, motion: Floats) -> Floats:
        """What a further motion comes to when this motion answers to it, and forces to that."""
        ...


@dataclass(frozen=True)
class Hand:
    """The motion that a hand makes: what is slow, because there the encoder sees it well.

    Attributes
    ----------
    period_s : float
    edge_hz : float
        Of what is slow: `hand_edge_hz`.
    response, usual : LinearSystem
        The mechanism without forces, and that with what they do on the average; batches of one.
    rests : AtRest, optional
        Where dry friction holds it.
    """

    period_s: float
    edge_hz: float
    response: LinearSystem
    usual: LinearSystem
    rests: AtRest | None = None

    def begin(self, left: Floats) -> Floats:
        return self.of(left)  # what is slow is measured, with all that forces do

    def of(self, left: Floats) -> Floats:
        hand = left if self.rests is None else self.rests.smoothest(left)
        return low_pass(hand, self.edge_hz, self.period_s)

    def off(self, taken: Floats, rest: Floats) -> Floats:
        return self.of(taken + rest) - taken

    def step(self, off: Floats) -> Floats:
        return (self.answered(off) + off) / 2  # what sticks does not answer

    def answered(self, motion: Floats) -> Floats:
        count = next_fast_len(len(motion), real=True)
        spectrum = np.fft.rfft(motion, count)
        far = 4.0  # edges, where a hundred-thousandth of the motion counts as slow
        frequency_hz = np.asarray(np.fft.rfftfreq(count, self.period_s)[: len(spectrum)])
        frequency_hz = frequency_hz[frequency_hz < far * self.edge_hz]
        frequency_hz[0] = frequency_hz[1]  # where a hand only damps there is no response at rest
        s = np.asarray(2j * np.pi * frequency_hz, dtype=complex)
        ratio = self.usual.continuous_response(s)[0] / self.response.continuous_response(s)[0]
        spectrum[: len(s)] /= 1 + slow_share(frequency_hz, self.edge_hz) * (ratio - 1)
        return np.fft.irfft(spectrum, count)[: len(motion)]


@dataclass(frozen=True)
class HandAfar(Hand):
    """A hand's motion beside a force between the masses, which hardly answers to it."""

    def answered(self, motion: Floats) -> Floats:
        return motion


@dataclass(frozen=True)
class Coasting:
    """A free device's coasting: how it began to move, and the motion under a constant force.

    Attributes
    ----------
    own, usual : ndarray, shape (N, 2 or 3)
        `coasting_motions` of the mechanism without forces, and of that with what they do on the
        average; as many as are `remembered`.
    mean : float
        Of the command: a force that is constant, and no other, as long as nothing else is known.
    """

    own: Floats
    usual: Floats
    mean: float

    def begin(self, left: Floats) -> Floats:
        # At rest.  What sticks and slides does not forget what the mean of its command is: of three
        # loops at their true parameters motions were found 3, 17 and 114 counts off without.
        return np.asarray(left[0] + self.mean * self.own[:, 1])

    def of(self, left: Floats) -> Floats:
        return np.asarray(self.own @ parts(self.own, left))

    def off(self, taken: Floats, rest: Floats) -> Floats:
        return np.asarray(self.usual @ parts(self.usual, rest))

    def step(self, off: Floats) -> Floats:
        return np.asarray(self.own @ parts(self.usual, off))

    def answered(self, motion: Floats) -> Floats:
        return np.asarray(motion + (self.own - self.usual) @ parts(self.usual, motion))


@dataclass(frozen=True)
class Nothing:
    """Where forces do not know of it."""

    def begin(self, left: Floats) -> Floats:
        return np.zeros_like(left)

    def of(self, left: Floats) -> Floats:
        return np.zeros_like(left)

    def off(self, taken: Floats, rest: Floats) -> Floats:
        return np.zeros_like(rest)

    def step(self, off: Floats) -> Floats:
        return off

    def answered(self, motion: Floats) -> Floats:
        return motion


def remembered(columns: Floats) -> Floats:
    """`coasting_motions` without the push where a hundredth of the recording forgets that.

    It cannot be told from standing elsewhere then; but where forces are taken for less than they
    are it goes far.
    """
    others, push = columns[:, :2], columns[:, 2]
    own = push - others @ parts(others, push)
    forgotten = 0.1  # root of the time
    return columns if np.std(own) > forgotten * np.sqrt(np.mean(push**2)) else others


def settled(
    besides: Besides, left: Floats, forced: Callable[[Floats], Floats], first: Floats
) -> Floats:
    """What forces add to the motion, found together with a motion that agrees with the measurement.

    Each step begins at the best mixture of the motions tried so far (D. G. Anderson, Journal of the
    ACM 12, 1965), because forces that are not the true ones answer differently from those that
    acted.

    Parameters
    ----------
    besides : Besides
    left : ndarray, shape (N,)
        The measured position less what the command does.
    forced : callable
        From the motion that nothing known makes to what each force adds, shape (F, N); nan where
        it runs away.
    first : ndarray, shape (N,)
        The motion that nothing known makes, to begin with.

    Returns
    -------
    ndarray, shape (F, N)
        The best that was found, where none agrees: a motion that sticks, or is chaotic, answers
        unlike the average.
    """
    taken, least, worse = first, np.inf, 0
    best = added = forced(first)
    motions: list[Floats] = []
    errors: list[Floats] = []
    for _ in range(1, _MOST):
        rest = left - added.sum(axis=0) - taken
        if not np.isfinite(rest[-1]):
            break
        off = besides.off(taken, rest)
        wrong = float(np.std(off))
        worse = worse + 1 if wrong > least else 0
        if not worse:
            best, least = added, wrong
        if wrong <= _SETTLED * np.std(rest) or worse == _WORSE:
            break
        motions, errors = [*motions, taken][-_MIXED:], [*errors, off][-_MIXED:]
        taken, off = _mixture(motions, errors)
        taken = taken + besides.step(off)
        added = forced(taken)
    return best


def _mixture(motions: list[Floats], errors: list[Floats]) -> tuple[Floats, Floats]:
    """The mixture of motions that is least off, and by how much, to first order."""
    change = np.diff(errors, axis=0).T
    share = lstsq(change, errors[-1], rcond=1e-8)[0] if change.size else np.zeros(0)
    return motions[-1] - share @ np.diff(motions, axis=0), errors[-1] - change @ share


def one_step(
    besides: Besides, left: Floats, forced: Callable[[Floats], Floats], near: Floats
) -> Floats:
    """What each force adds, to first order in how that differs from `near`, shapes (F, N)."""
    further = forced(besides.of(left - near.sum(axis=0))) - near
    return near + np.array([besides.answered(one) for one in further])
