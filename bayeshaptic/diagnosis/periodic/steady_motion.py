"""The steady periodic motion that a periodic force makes, and what internal forces add to it.

A recording whose force repeats ends in a motion that repeats with it, nonlinear or not.  Over one
period every signal is a sum of harmonics, on which a linear mechanism acts by a number each: the
motion that obeys an internal force is found by harmonic balance, forces from motion in time and
motion from forces in frequency, in turn (T. M. Cameron and J. H. Griffin, J. Appl. Mech. 56,
149-154, 1989).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.periodic.period import Period
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.models.response.mechanism import Pair
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomials.polynomial import evaluate
from bayeshaptic.numerics.spending import spend
from bayeshaptic.types import Complexes, Floats

# Cost of setting up responses and evaluating them some times, for each sample of a period, in units
# of one value of a rational model.
_COST = 25.0


class Responses:
    """Stretch of one pair of points by a force between another, on the harmonics of a period.

    Reciprocal.
    """

    def __init__(self, system: LinearSystem, period: Period) -> None:
        self.mechanism = system.mechanism
        self._points = period.s[:, None]
        self._denominator = evaluate(system.mechanism.transfer()[1], self._points)[:, 0]
        self._found: dict[tuple[Pair, Pair], Complexes] = {}

    def __call__(self, at: Pair, by: Pair) -> Complexes:
        if (at, by) not in self._found:
            numerator = evaluate(self.mechanism.mutual(by, at), self._points)[:, 0]
            self._found[at, by] = self._found[by, at] = numerator / self._denominator
        return self._found[at, by]


def pair_of(place: Place) -> Pair:
    """The two points between which an internal force acts."""
    return place.first, place.second


@dataclass(frozen=True)
class Applied:
    """Internal forces at places, as their own motion would have them: k x + c v and a rest.

    What is proportional to the motion is solved for with it, so that going back and forth between
    motion and force converges where the force is no longer small.

    Attributes
    ----------
    places : tuple of Place
    proportional : complex ndarray, shape (Q, H)
        k + c s of every place.
    rest : complex ndarray, shape (Q, H)
        On the harmonics.
    """

    places: tuple[Place, ...]
    proportional: Complexes
    rest: Complexes


def no_force(period: Period, places: tuple[Place, ...]) -> Applied:
    """Nothing acts."""
    zero = np.zeros((len(places), len(period.harmonics)), complex)
    return Applied(places, zero, zero)


def apply(
    period: Period, forces: Mapping[Place, Floats], motions: Mapping[Place, Motion]
) -> Applied:
    """Forces over one period, shape (N,) each, taken apart by regression on their motion.

    Raises
    ------
    numpy.linalg.LinAlgError
        Where the motion runs away.
    """
    proportional, rest = [], []
    for place, force in forces.items():
        velocity = motions[place].velocity
        motion = np.stack([motions[place].position, velocity - velocity.mean()], axis=1)
        size = np.sqrt(np.mean(motion**2, axis=0))
        if not (np.all(np.isfinite(size)) and np.all(np.isfinite(force))):
            raise np.linalg.LinAlgError("the motion runs away")
        share = np.linalg.lstsq(motion / size, force - force.mean(), rcond=None)[0] / size
        proportional.append(share[0] + share[1] * period.s)
        rest.append(period.transform(force - motion @ share))
    return Applied(tuple(forces), np.array(proportional), np.array(rest))


@dataclass
class Following:
    """Forces in time on their way to those that their own motion asks for.

    Strong friction slows the motion, which then asks for less friction.  Steps that turn back get
    shorter, so that the way ends instead of going round.

    Attributes
    ----------
    share : float
        Of the step to go.
    force, step : dict or None
        By place: where the forces are, and what the last motion asked for beyond that.
    """

    share: float = 1.0
    force: dict[Place, Floats] | None = None
    step: dict[Place, Floats] | None = None

    def toward(self, wanted: dict[Place, Floats]) -> dict[Place, Floats]:
        """The forces after one more step, shape (N,) each."""
        if self.force is None:
            self.force = wanted
            return wanted
        step = {place: wanted[place] - self.force[place] for place in wanted}
        if self.step is not None:
            back = sum(float(step[place] @ self.step[place]) for place in step) < 0
            self.share = 0.5 * self.share if back else min(1.5 * self.share, 1.0)
        self.step = step
        self.force = {place: self.force[place] + self.share * step[place] for place in step}
        return self.force

    @property
    def arrived(self) -> bool:
        """Whether the motion asks for next to nothing beyond the forces that act, rms.

        Of dry friction in twenty recordings of a free device, what settled had at most 3 % to go,
        what went round still 19 % and more.
        """
        return self.is_within(0.05)

    def is_within(self, to_go: float) -> bool:
        """Whether the motion asks for a further force of at most that share of the forces, rms."""
        if self.force is None or self.step is None:
            return False
        missing, there = (sum(f @ f for f in each.values()) for each in (self.step, self.force))
        return bool(missing <= to_go**2 * there)


class Steady:
    """The steady periodic motion at places under the command, for given forces there.

    Parameters
    ----------
    system : LinearSystem
        A batch of one.
    period : Period
    places : tuple of Place
    """

    def __init__(self, system: LinearSystem, period: Period, places: tuple[Place, ...]) -> None:
        spend(_COST * period.samples)
        responses, drive = Responses(system, period), system.mechanism.drive
        own = responses(drive, drive)
        frequency = period.s.imag / (2 * np.pi)
        # What the loop does to the command before it is a force: hold, delay, filters.
        motor = system.sampled_response(frequency, period.period_s)[0]
        pairs = [pair_of(place) for place in places]
        driven = np.stack([responses(pair, drive) for pair in pairs])
        self.between = np.stack([[responses(at, by) for by in pairs] for at in pairs])  # (Q, Q, H)
        self.period = period
        self._by_command = driven * period.transform(period.force) * motor / own
        self._measured = driven / own * period.transform(period.position)

    def __call__(self, applied: Applied) -> dict[Place, Motion]:
        """The motion at the places, one period each."""
        period, between = self.period, self.between
        free = self._by_command + np.einsum("abh,bh->ah", between, applied.rest)
        matrix = np.eye(len(between))[:, :, None] - between * applied.proportional[None]
        lines = np.linalg.solve(np.moveaxis(matrix, 2, 0), free.T[:, :, None])[:, :, 0].T
        lines = np.where(period.free, self._measured, lines)
        return {
            place: Motion(
                period.signal(row),
                period.signal(period.s * row) + (period.creep if place.second is None else 0.0),
                period.force,
            )
            for place, row in zip(applied.places, lines, strict=True)
        }


def steady_motion(system: LinearSystem, period: Period, applied: Applied) -> dict[Place, Motion]:
    """The motion at the places, one period each, under the command and internal forces.

    Parameters
    ----------
    system : LinearSystem
        A batch of one.
    period : Period
    applied : Applied

    Returns
    -------
    dict
    """
    return Steady(system, period, applied.places)(applied)


def places_of(system: LinearSystem) -> tuple[Place, ...]:
    """Where internal forces may act: on every mass, and between the first two."""
    masses = tuple(Place(n, None) for n in range(len(system.mechanism.masses)))
    return masses if len(masses) == 1 else (*masses, CONNECTION)
