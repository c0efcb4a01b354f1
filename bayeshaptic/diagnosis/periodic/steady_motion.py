"""The steady periodic motion that a periodic force makes, and what internal forces add to it.

A recording whose force repeats ends in a motion that repeats with it, nonlinear or not.  Over one
period every signal is a sum of harmonics, on which a linear mechanism acts by a number each: the
motion that obeys an internal force is found by harmonic balance, forces from motion in time and
motion from forces in frequency, in turn (T. M. Cameron and J. H. Griffin, J. Appl. Mech. 56,
149-154, 1989).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.errors import InputError
from bayeshaptic.models.response.mechanism import Pair
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomial import evaluate
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.signals.excitation import find_repetition
from bayeshaptic.types import Complexes, Floats

LOAD = Place(1, None)


@dataclass(frozen=True)
class Period:
    """One period of a recording, averaged over the kept ones.

    Attributes
    ----------
    force, position : ndarray, shape (N,)
        Without mean, and without the way that the device goes on from period to period.
    harmonics : ndarray of int, shape (H,)
        Those the motion is made of, from 1.
    excited : ndarray of int, shape (L,)
        The lines of the spectra.
    scale : ndarray, shape (L,)
        From the DFT of one period to the scale of the spectra.
    period_s : float
        Of sampling.
    creep : float
        Mean velocity: a constant force, or one that a law makes, drives a free device on.
    """

    force: Floats = field(repr=False)
    position: Floats = field(repr=False)
    harmonics: NDArray[np.int64] = field(repr=False)
    excited: NDArray[np.int64] = field(repr=False)
    scale: Floats = field(repr=False)
    period_s: float
    creep: float

    @property
    def samples(self) -> int:
        return len(self.force)

    @property
    def s(self) -> Complexes:
        """j omega of the harmonics, rad/s, shape (H,)."""
        return np.asarray(2j * np.pi * self.harmonics / (self.samples * self.period_s))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Harmonics below all excited ones: no force there, what moves is taken as measured."""
        return self.harmonics < self.excited[0]

    def transform(self, signal: Floats) -> Complexes:
        """DFT of signals (..., N) at the harmonics, (..., H)."""
        return np.asarray(np.fft.rfft(signal, axis=-1)[..., self.harmonics])

    def signal(self, lines: Complexes) -> Floats:
        """Back to time, shape (N,), without mean."""
        full = np.zeros(self.samples // 2 + 1, complex)
        full[self.harmonics] = lines
        return np.fft.irfft(full, self.samples)

    def at_lines(self, lines: Complexes) -> Complexes:
        """Harmonics (..., H) to the lines of the spectra and in their scale, (..., L)."""
        return np.asarray(lines[..., self.excited - self.harmonics[0]] * self.scale)


def one_period(etfe: Etfe, witness: Floats | None = None) -> Period:
    """The averaged period of a periodic recording.

    Parameters
    ----------
    etfe : Etfe
    witness : ndarray, shape (samples,), optional
        Another position to average instead of the recording's.

    Raises
    ------
    InputError
        Where the force does not repeat or there is no recording.
    """
    recording, spectra = etfe.recording, etfe.spectra
    repetition = None if recording is None else find_repetition(recording.force)
    if recording is None or repetition is None or not isinstance(spectra, PeriodicSpectra):
        raise InputError("a steady periodic motion needs a recording whose force repeats.")
    samples = repetition.period
    stop = min(repetition.stop + 1, recording.samples)
    first = stop - spectra.periods * samples
    position = (recording.position if witness is None else witness)[first:stop]
    centres = position.reshape(-1, samples).mean(axis=1)
    creep = float(centres[-1] - centres[0]) / max((len(centres) - 1) * samples, 1)  # a sample
    position = position - creep * np.arange(len(position))
    force = repetition.periods_of(recording.force, first, spectra.periods).mean(axis=0)
    excited = np.rint(spectra.frequency_hz * samples * recording.period_s).astype(int)
    overtones = 2.0  # harmonics of the motion up to so many times the highest excited one
    last = min(int(overtones * excited[-1]), (samples - 1) // 2)
    return Period(
        force=force - force.mean(),
        position=position.reshape(-1, samples).mean(axis=0),
        harmonics=np.arange(1, last + 1),
        excited=excited,
        scale=np.abs(spectra.force) / np.abs(np.fft.rfft(force)[excited]),
        period_s=recording.period_s,
        creep=creep / recording.period_s,
    )


class Responses:
    """Stretch of one pair of points by a force between another, on the harmonics of a period."""

    def __init__(self, system: LinearSystem, period: Period) -> None:
        self.mechanism = system.mechanism
        self._points = period.s[:, None]
        self._denominator = evaluate(system.mechanism.transfer()[1], self._points)[:, 0]
        self._found: dict[tuple[Pair, Pair], Complexes] = {}

    def __call__(self, at: Pair, by: Pair) -> Complexes:
        if (at, by) not in self._found:
            numerator = evaluate(self.mechanism.mutual(by, at), self._points)[:, 0]
            self._found[at, by] = numerator / self._denominator
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
    """Forces in time on the way to those that their motion asks for.

    Strong friction slows the motion, which then asks for less: steps that turn back get shorter, so
    that the way ends and does not go round.

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
        to_go = 0.05  # of the forces
        if self.force is None or self.step is None:
            return False
        missing, there = (sum(f @ f for f in each.values()) for each in (self.step, self.force))
        return bool(missing <= to_go**2 * there)


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
    responses, drive = Responses(system, period), system.mechanism.drive
    own = responses(drive, drive)
    frequency = period.s.imag / (2 * np.pi)
    # What the loop does to the command before it is a force: hold, delay, filters.
    motor = system.sampled_response(frequency, period.period_s)[0]
    command = period.transform(period.force) * motor / own
    pairs = [pair_of(place) for place in applied.places]
    driven = np.stack([responses(pair, drive) for pair in pairs])
    between = np.stack([[responses(at, by) for by in pairs] for at in pairs])  # (Q, Q, H)
    free = driven * command + np.einsum("abh,bh->ah", between, applied.rest)
    matrix = np.eye(len(pairs))[:, :, None] - between * applied.proportional[None]
    lines = np.linalg.solve(np.moveaxis(matrix, 2, 0), free.T[:, :, None])[:, :, 0].T
    lines = np.where(period.free, driven / own * period.transform(period.position), lines)
    return {
        place: Motion(
            period.signal(row),
            period.signal(period.s * row) + (period.creep if place.second is None else 0.0),
            period.force,
        )
        for place, row in zip(applied.places, lines, strict=True)
    }


def places_of(system: LinearSystem) -> tuple[Place, ...]:
    """Where internal forces may act: on every mass, and between the first two."""
    masses = tuple(Place(n, None) for n in range(len(system.mechanism.masses)))
    return masses if len(masses) == 1 else (*masses, CONNECTION)


def with_floor(etfe: Etfe, floor: float) -> Etfe:
    """The same, each line's noise at least `floor` times its response.

    Parameters
    ----------
    etfe : Etfe
        Periodic.
    floor : float
        For example 0.002.
    """
    spectra = etfe.spectra
    assert isinstance(spectra, PeriodicSpectra)
    least = (spectra.freedom - 2) * (floor * np.abs(spectra.position)) ** 2
    return replace(etfe, spectra=replace(spectra, scatter=np.maximum(spectra.scatter, least)))
