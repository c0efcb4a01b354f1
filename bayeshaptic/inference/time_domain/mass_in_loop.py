"""A recording, and the motion of one mass simulated beside it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference.time_domain.follower import Follower, spring_and_damper
from bayeshaptic.inference.time_domain.mass_forces import COULOMB, MassForces, simulate
from bayeshaptic.inference.time_domain.uneven import WAVES, Way, waves
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats, Ints

# The values that are the same in all pieces, and where they are.
NAMES = ("m", "b", "coulomb", "offset", "delay_s")
SHARED = len(NAMES)
MASS, DAMPING, DRY, OFFSET, DELAY = range(SHARED)
FORCES = [DRY, OFFSET]
_LARGEST = 10.0  # of the command's rms: no friction, and no constant force, is larger
_LOWEST = (0.0, 0.0, 0.0, -np.inf, 0.0)


@dataclass(frozen=True)
class Hum:
    """A force Re(amplitude e^(2 pi i frequency_hz t)) on the mass, from a piece's first sample on.

    Its amplitude is where the fit begins.
    """

    frequency_hz: float
    amplitude: complex

    def later(self, seconds: float) -> Hum:
        """The same, from so many seconds later on."""
        turned = np.exp(2j * np.pi * self.frequency_hz * seconds)
        return replace(self, amplitude=complex(self.amplitude * turned))


@dataclass(frozen=True)
class MassInLoop:
    """A recording with a follower, and the motion of one mass beside it.

    Values are the `SHARED` ones, then those of every piece: position and velocity at its
    beginning, cosine and sine of every hum; then the numbers of the laws of force.

    Attributes
    ----------
    force, position : ndarray, shape (N,)
    period_s, bandwidth_hz : float
    shapes : ndarray, shape (WAVES, N)
        Of the force that changes along the way.
    pieces : tuple of slice
    follower : Follower or None
        None until `led`.
    forces : MassForces
        Dry friction's law, and further ones.
    hums : tuple of Hum
    name : str
        Of the recording, for messages.
    """

    force: Floats = field(repr=False)
    position: Floats = field(repr=False)
    period_s: float
    bandwidth_hz: float
    shapes: Floats = field(repr=False)
    pieces: tuple[slice, ...]
    follower: Follower | None = None
    forces: MassForces = COULOMB
    hums: tuple[Hum, ...] = ()
    name: str = "recording"

    @classmethod
    def of(
        cls,
        recording: Recording,
        bandwidth_hz: float,
        way: Way,
        forces: MassForces = COULOMB,
        hums: tuple[Hum, ...] = (),
    ) -> MassInLoop:
        """Of a recording, with the waves of a way."""
        force, position = np.array(recording.force), np.array(recording.position)
        return cls(
            force,
            position,
            recording.period_s,
            bandwidth_hz,
            waves(position, way),
            recording.spans,
            forces=forces,
            hums=hums,
            name=recording.name,
        )

    @property
    def plain(self) -> int:
        """How many values there are."""
        return self._laws_from + len(self.forces.names)

    @property
    def _laws_from(self) -> int:
        """Where the numbers of the laws begin."""
        return SHARED + self._own * len(self.pieces)

    @property
    def _own(self) -> int:
        """How many values a piece has for itself."""
        return 2 + 2 * len(self.hums)

    @property
    def lowest(self) -> Floats:
        """Below which no value may go, shape (plain,)."""
        least = 1e-3  # of a law's number: none is below zero
        anywhere = np.full(self._laws_from - SHARED, -np.inf)
        return np.concatenate([_LOWEST, anywhere, least * self.forces.start])

    @property
    def highest(self) -> Floats:
        """Above which no value may go, shape (plain,)."""
        return np.append(np.full(self._laws_from, np.inf), self.forces.most)

    @property
    def reach(self) -> Floats:
        """How far from here any value may be where nothing says more, shape (plain,).

        What a mass that friction holds is begun with is lost within a sample, and slopes say that
        it could have any velocity.
        """
        found = np.full(self.plain, np.inf)
        found[FORCES] = _LARGEST * np.std(self.force)
        found[[own[1] for own in self.beginnings]] = np.std(np.diff(self.position)) / self.period_s
        return found

    @property
    def beginnings(self) -> list[Ints]:
        """Which values are a piece's own: its beginning, and its hums."""
        firsts = range(SHARED, self._laws_from, self._own)
        return [np.arange(first, first + self._own) for first in firsts]

    def begun(self, shared: Floats, numbers: Floats | None = None) -> Floats:
        """Values with the pieces' beginnings as measured; shape (plain,).

        A mass that moves is not found from rest where it rubs: slopes say there that friction takes
        whatever velocity it is begun with.
        """
        first = np.zeros((len(self.pieces), self._own))
        first[:, 0] = self.position[[piece.start for piece in self.pieces]]
        first[:, 1] = [self._speed_at_first(self.position[piece]) for piece in self.pieces]
        begun = np.array([hum.amplitude for hum in self.hums])
        first[:, 2:] = np.append(begun.real, -begun.imag)
        own = self.forces.start if numbers is None else numbers
        return np.concatenate([shared, first.ravel(), own])

    def _speed_at_first(self, position: Floats) -> float:
        """Of a parabola through what a piece does before its command changes much, in units/s."""
        fewest = 5
        samples = max(round(1 / (2 * np.pi * self.bandwidth_hz * self.period_s)), fewest)
        some = position[:samples]
        return float(np.polyfit(np.arange(len(some)) * self.period_s, some, 2)[1])

    def hums_at(self, values: Floats) -> tuple[Hum, ...]:
        """The hums with the cosines and sines of the first piece."""
        cosine, sine = values[self.beginnings[0][2:]].reshape(2, -1)
        found = zip(self.hums, cosine - 1j * sine, strict=True)
        return tuple(replace(hum, amplitude=complex(amplitude)) for hum, amplitude in found)

    @property
    def white(self) -> bool:
        """Whether errors are independent of each other."""
        return False

    @property
    def independent(self) -> float:
        """How many independent samples this is worth, about."""
        seconds = len(self.force) * self.period_s
        independent = 3.0  # samples that a second is worth, a hertz of bandwidth
        fewest = 20  # independent samples
        return max(independent * self.bandwidth_hz * seconds, fewest)

    def led(self, feedback: Follower | None, start: Floats, share: float = 1.0) -> MassInLoop:
        """With the declared follower, or one of `share` times the bandwidth that is stable."""
        width = share * self.bandwidth_hz
        trials = 10
        calmer = 1.6  # the bandwidth is lowered by this until the start can be simulated
        for _ in range(trials):
            chosen = feedback or spring_and_damper(start[MASS], width, self.period_s)
            loop = replace(self, bandwidth_hz=width, follower=chosen)
            error = loop.error(start, np.zeros(2 * WAVES))
            if np.all(np.isfinite(error)) and np.abs(error).max() < 10 * np.ptp(self.position):
                break
            width, feedback = width / calmer, None
        return loop

    def error(self, values: Floats, uneven: Floats, more: Floats | float = 0.0) -> Floats:
        """Measured less simulated position, shape (N,); `more` is a force on the mass."""
        assert self.follower is not None
        mass, damping, dry, offset, delay_s = values[:SHARED]
        laws = self.forces.laws(dry, values[self._laws_from :])
        forward, backward = uneven.reshape(2, WAVES) @ self.shapes + more
        simulated = np.empty_like(self.position)
        for piece, own in zip(self.pieces, self.beginnings, strict=True):
            hum = values[own[2:]] @ self._waves(piece.stop - piece.start)
            with np.errstate(all="ignore"):
                simulated[piece] = simulate(
                    np.array([mass, damping, offset, delay_s, *values[own[:2]]]),
                    laws,
                    forward[piece] + hum,
                    backward[piece] + hum,
                    self.force[piece],
                    self.position[piece],
                    self.follower,
                    self.period_s,
                )
        return self.position - simulated

    def _waves(self, samples: int) -> Floats:
        """Cosine and sine of every hum from a piece's first sample on, shape (2 H, samples)."""
        frequency_hz = [hum.frequency_hz for hum in self.hums]
        turns = 2 * np.pi * np.outer(frequency_hz, np.arange(samples) * self.period_s)
        return np.concatenate([np.cos(turns), np.sin(turns)])

    def columns(self, values: Floats, uneven: Floats, error: Floats) -> Floats:
        """How the simulated position moves with every value and wave, shape (N, C)."""
        size = float(np.std(self.force))
        heavier, thicker = 1e-3 * values[MASS], 1e-2 * max(values[DAMPING], values[MASS])
        steps = np.array([heavier, thicker, 2e-3 * size, 2e-3 * size, 0.05 * self.period_s])
        out = np.zeros((len(error), self.plain + 2 * WAVES))
        for i, step in enumerate(steps):
            out[:, i] = self._slope(values, uneven, [i], step)
        for piece, own, slopes in self._begins(values, uneven):
            out[piece, own] = slopes
        for i, number in enumerate(self.forces.start, self._laws_from):
            out[:, i] = self._slope(values, uneven, [i], 1e-2 * max(values[i], 0.1 * number))
        for i in range(2 * WAVES):
            more = uneven.copy()
            more[i] += 1e-3 * size
            with np.errstate(invalid="ignore"):  # of a motion that runs away
                out[:, self.plain + i] = (error - self.error(values, more)) / (1e-3 * size)
        return out

    def _begins(self, values: Floats, uneven: Floats) -> Iterator[tuple[slice, Ints, Floats]]:
        """Every piece, which values are its own, and how it moves with them, shape (n, own)."""
        far = 1e-6 * float(np.ptp(self.position))
        fast = 1e-4 * float(np.std(np.diff(self.position))) / self.period_s
        hums = [1e-3 * float(np.std(self.force))] * (self._own - 2)
        # What the pieces have of their own moves in all of them at once: each answers to its own.
        slopes = np.stack(
            [
                self._slope(values, uneven, [own[i] for own in self.beginnings], step)
                for i, step in enumerate((far, fast, *hums))
            ],
            axis=1,
        )
        for piece, own in zip(self.pieces, self.beginnings, strict=True):
            yield piece, own, slopes[piece]

    def with_beginnings(self, values: Floats, uneven: Floats) -> Floats:
        """`values`, with what the pieces have of their own as it fits best."""
        best, error = values, self.error(values, uneven)
        steps = 5  # of Gauss-Newton; a motion without friction takes one
        for _ in range(steps):
            trial = best.copy()
            for piece, own, slopes in self._begins(best, uneven):
                if not np.isfinite(slopes).all():  # a motion that runs away begins nowhere
                    return best
                trial[own] += np.linalg.lstsq(slopes, error[piece], rcond=None)[0]
            left = self.error(trial, uneven)
            if not left @ left < (1 - 1e-3) * (error @ error):
                break
            best, error = trial, left
        return best

    def _slope(self, values: Floats, uneven: Floats, moved: list[int], step: float) -> Floats:
        """How the simulated position moves with values that move together, shape (N,)."""
        up, down = values.copy(), values.copy()
        up[moved] += step
        down[moved] = np.maximum(down[moved] - step, self.lowest[moved])
        span = up[moved[0]] - down[moved[0]]
        with np.errstate(invalid="ignore"):  # of a motion that runs away
            return np.asarray((self.error(down, uneven) - self.error(up, uneven)) / span)

    def answer(self, values: Floats, uneven: Floats, error: Floats, force: Floats) -> Floats:
        """How the simulated position moves with the strength of a force, shape (N,)."""
        step = 1e-3 * float(np.std(self.force)) / max(float(np.std(force)), np.finfo(float).tiny)
        return (error - self.error(values, uneven, step * force)) / step
