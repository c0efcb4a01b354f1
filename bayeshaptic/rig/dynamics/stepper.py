"""Time steps with nonlinear forces and delayed springs: exact where linear, sticking exactly."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.laws import DryFriction, SmoothLaw
from bayeshaptic.rig.dynamics.plant import Array, Plant
from bayeshaptic.rig.dynamics.propagate import Stretch, generator, layout, stretches

SUBSTEPS = 8
HALVINGS = 6
# How often the force at the end of a step is looked up again where the step then ends.
CORRECTIONS = 2


@dataclass(frozen=True)
class Step:
    """A step of one length: matrix, and what nonlinear forces do that act on top of it.

    Attributes
    ----------
    matrix : ndarray, shape (size, size)
    constant, ramp : list of ndarray, shape (size,)
        Response at the end of the step to a force of 1 throughout, and one that grows from 0 to 1.
    grip : list of float
        Velocity that a force of 1 throughout gives its own coordinate.
    """

    matrix: Array
    constant: list[Array]
    ramp: list[Array]
    grip: list[float]


def _step(plant: Plant, length_s: float) -> Step:
    at, small = layout(plant), generator(plant)
    size, n, laws = at.size, at.states, at.laws
    wide = np.zeros((size + laws, size + laws))
    wide[:size, :size] = small
    for j in range(laws):
        wide[at.first_law + j, size + j] = 1 / length_s
    power = scipy.linalg.expm(wide * length_s)
    constant = power[:size, at.first_law : at.first_delayed].copy()
    constant[n:] = 0
    ramp = power[:size, size:].copy()
    ramp[n:] = 0
    grip = np.einsum("jn,nj->j", plant.law_motion[:, 1], constant[:n])
    return Step(
        np.ascontiguousarray(power[:size, :size]),
        list(np.ascontiguousarray(constant.T)),
        list(np.ascontiguousarray(ramp.T)),
        grip.tolist(),
    )


@dataclass(frozen=True)
class Coordinate:
    """Where a law finds its relative position and velocity: state indices, -1 for none."""

    x: int
    x_minus: int
    v: int
    v_minus: int

    def position(self, z: Array) -> float:
        return z.item(self.x) - (z.item(self.x_minus) if self.x_minus >= 0 else 0.0)

    def velocity(self, z: Array) -> float:
        return z.item(self.v) - (z.item(self.v_minus) if self.v_minus >= 0 else 0.0)


def _coordinate(motion: Array) -> Coordinate:
    found = []
    for row in motion:
        minus = np.flatnonzero(row < 0)
        found += [int(np.argmax(row)), int(minus[0]) if len(minus) else -1]
    return Coordinate(*found)


class Stepper:
    """A plant in time: set the inputs of a period, take it, read the position.

    A step of the linear part is a matrix exponential. Smooth laws are predicted with their force at
    the beginning of the step and corrected by the ramp to their force at its end (second order,
    Cox and Matthews, J. Comput. Phys. 176, 2002). Dry friction slides with a constant force while
    the velocity keeps its sign; a step in which it does not is halved, `halvings` times at most. At
    the bottom the force is the one that brings the velocity to exactly zero, or, where friction
    cannot hold against the other forces, the mean of the old direction's and the new one's. A stuck
    mass does not move at all.

    Parameters
    ----------
    plant : Plant
    period_s : float
    substeps : int
        Steps a period, at least; one where there is nothing but linear dynamics.
    halvings : int
        How often a step may be halved to find where friction reverses.
    """

    def __init__(
        self, plant: Plant, period_s: float, substeps: int = SUBSTEPS, halvings: int = HALVINGS
    ) -> None:
        self.period_s = period_s
        self.substeps = substeps if plant.laws or plant.delayed else 1
        self.halvings = halvings if any(law.dry for law in plant.laws) else 0
        self.z = np.zeros(layout(plant).size)
        self.mode = [0] * len(plant.laws)
        self.history: list[list[float]] = [[0.0] for _ in plant.delayed]
        self.retune(plant)

    def retune(self, plant: Plant) -> None:
        """Go on with another plant of the same layout: positions and velocities stay."""
        self.plant, self.at = plant, layout(plant)
        self.stretches = stretches(plant.delay_s, self.period_s, self.substeps)
        self.tables = [
            [_step(plant, stretch.step_s / 2**level) for level in range(self.halvings + 1)]
            for stretch in self.stretches
        ]
        coordinates = [_coordinate(motion) for motion in plant.law_motion]
        first = self.at.first_law
        numbered = list(enumerate(zip(plant.laws, coordinates, strict=True)))
        self.smooth = [
            (j, first + j, law, place) for j, (law, place) in numbered if isinstance(law, SmoothLaw)
        ]
        self.dry = [
            (j, first + j, law, place)
            for j, (law, place) in numbered
            if isinstance(law, DryFriction)
        ]
        self.lookup = [
            delay_lookup(self.stretches, self.period_s, spring.delay_s) for spring in plant.delayed
        ]

    def start(self, state: Array) -> None:
        """Begin with a mechanical state, shape (n,)."""
        self.z[: self.at.states] = state
        for j, slot, law, place in self.dry:
            self.mode[j] = int(np.sign(place.velocity(self.z)))
            self.z[slot] = -self.mode[j] * law.bound(place.velocity(self.z))
        for _, slot, smooth, place in self.smooth:
            self.z[slot] = smooth.force(place.position(self.z), place.velocity(self.z), 0.0, 0.0)
        for j, row in enumerate(self.plant.delayed_signals):
            self.history[j] = [float(row @ state)]

    @property
    def state(self) -> Array:
        """The plant's state, shape (n,)."""
        return self.z[: self.at.states]

    def advance(self, old: float, new: float, hand: float, hand_next: float) -> None:
        """Take one period.

        Parameters
        ----------
        old, new : float
            Command that acts until the rest of the delay has passed, and afterwards.
        hand, hand_next : float
            Hand force at the beginning and the end of the period.
        """
        at, z, piece = self.at, self.z, 0
        z[at.hand] = hand
        z[at.hand_slope] = (hand_next - hand) / self.period_s
        simple = not (self.plant.laws or self.plant.delayed)
        for stretch, table in zip(self.stretches, self.tables, strict=True):
            z[at.command] = new if stretch.new else old
            for _ in range(stretch.steps):
                if simple:
                    z = table[0].matrix @ z
                    continue
                if self.history:
                    self._set_delayed(z, piece, stretch.step_s)
                z = self._take(z, table, 0)
                self._remember(z)
                piece += 1
        self.z = z

    def _take(self, z: Array, table: list[Step], level: int) -> Array:
        """The state after a step, or after its two halves where friction reverses in it."""
        step = table[level]
        end = step.matrix @ z
        applied = [z.item(slot) for _, slot, _, _ in self.smooth]
        for _ in range(CORRECTIONS if applied else 0):
            for i, (j, slot, law, place) in enumerate(self.smooth):
                q = place.position(end)
                moved = q - place.position(z)
                force = law.force(q, place.velocity(end), z.item(slot), moved)
                end += step.ramp[j] * (force - applied[i])
                applied[i] = force
        if self.dry:
            modes = self._rub(z, end, step, level == self.halvings)
            if modes is None:
                return self._take(self._take(z, table, level + 1), table, level + 1)
            for (j, slot, friction, place), mode in zip(self.dry, modes, strict=True):
                self.mode[j] = mode
                if mode:
                    end[slot] = -mode * friction.bound(place.velocity(end))
        for _, slot, law, place in self.smooth:
            q = place.position(end)
            end[slot] = law.force(q, place.velocity(end), z.item(slot), q - place.position(z))
        return end

    def _rub(self, z: Array, end: Array, step: Step, finest: bool) -> list[int] | None:
        """Add dry friction to the end of a step; None where one begins, ends or turns in it."""
        modes = []
        for j, slot, law, place in self.dry:
            mode, before, grip = self.mode[j], z.item(slot), step.grip[j]
            v = place.velocity(end)
            if mode and v * mode > 0:
                if not law.constant:
                    end += step.ramp[j] * (-mode * law.bound(v) - before)
                modes.append(mode)
                continue
            if mode and not finest:
                return None
            # What the velocity would gain in the step without this friction decides if it can hold.
            start = place.velocity(z) if mode else 0.0
            gain = v - before * grip - start
            sticks = abs(gain) <= law.static * grip
            if not sticks and not finest:
                return None
            if sticks:
                force = -(gain + start) / grip
            elif mode:
                force = before * (2 * start / (start - v) - 1)
            else:
                force = -math.copysign(law.static, gain)
            end += step.constant[j] * (force - before)
            end[slot] = force
            modes.append(0 if sticks else int(math.copysign(1, gain)))
            if sticks:
                self._pin(z, end, place, was_stuck=mode == 0)
        return modes

    @staticmethod
    def _pin(z: Array, end: Array, place: Coordinate, was_stuck: bool) -> None:
        """A mass that stuck stands still: remove what rounding and the step left of its motion."""
        if place.v_minus >= 0:
            return
        end[place.v] = 0.0
        if was_stuck:
            end[place.x] = z[place.x]

    def _set_delayed(self, z: Array, piece: int, length_s: float) -> None:
        """The forces of the delayed springs over the step to come, as straight lines."""
        at = self.at
        for j, history in enumerate(self.history):
            back, weight = self.lookup[j][piece]
            last = len(history) - 1 - back
            early = history[last] if last >= 0 else 0.0
            late = history[min(last + 1, len(history) - 1)] if last + 1 >= 0 else 0.0
            target = early + weight * (late - early)
            z[at.first_slope + j] = (target - z[at.first_delayed + j]) / length_s

    def _remember(self, z: Array) -> None:
        for history, row in zip(self.history, self.plant.delayed_signals, strict=True):
            history.append(float(row @ z[: self.at.states]))


def delay_lookup(
    parts: tuple[Stretch, ...], period_s: float, delay_s: float
) -> list[tuple[int, float]]:
    """For the end of each step: where its time less the delay lies between the step boundaries.

    Returns
    -------
    list of tuple
        (how many boundaries before the step's beginning, weight of the boundary after that one).
    """
    steps = [part.step_s for part in parts for _ in range(part.steps)]
    if delay_s < max(steps):
        raise InputError(
            f"a delayed spring's delay of {delay_s:g} s is shorter than a step of "
            f"{max(steps):g} s; use a longer delay or more substeps"
        )
    ends = np.cumsum(steps)
    ends[-1] = period_s
    count = len(steps)
    lookup = []
    for piece, end in enumerate(ends):
        time = end - delay_s
        period = math.floor(time / period_s + 1e-12)
        inside = max(time - period * period_s, 0.0)
        after = min(int(np.searchsorted(ends, inside, side="right")), count - 1)
        start = ends[after - 1] if after else 0.0
        boundary = period * count + after
        lookup.append((piece - boundary, float((inside - start) / steps[after])))
    return lookup
