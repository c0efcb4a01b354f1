"""The motion of one recording with internal forces in it, simulated.

What goes into the laws is the simulated motion, without encoder noise; taking sign(v) from the
encoder would miss half of the friction.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.residuals.unforced import coasting_motions, hand_edge_hz
from bayeshaptic.diagnosis.trials.forces.at_rest import AtRest, at_rest
from bayeshaptic.diagnosis.trials.forces.besides import (
    Besides,
    Coasting,
    Hand,
    HandAfar,
    Nothing,
    one_step,
    remembered,
    settled,
)
from bayeshaptic.effects.nonlinear.internal_force import (
    CONNECTION,
    LOAD,
    MOTOR,
    Internal,
    Place,
    forced_motion,
)
from bayeshaptic.effects.nonlinear.observer import correction, stretched
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, Motion
from bayeshaptic.models import Model
from bayeshaptic.models.response.filters import in_time
from bayeshaptic.models.response.motion import linear_motion, linear_motions
from bayeshaptic.numerics.spending import spend
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

SUBSTEPS = 8


@dataclass(frozen=True)
class Simulation:
    """Simulates what forces add to a measured motion.

    Attributes
    ----------
    model : Model
    recording : Recording
        With what the forces do in it.
    usual : ndarray, shape (P,)
        The linear parameters that fit it where no force is taken off.
    there : ndarray, shape (N,)
        What forces that are known to act in it add to the motion.
    rests : AtRest, optional
        Where friction holds the motor, and its force is told from how smoothly a hand moves.
    """

    model: Model
    recording: Recording
    usual: Floats
    there: Floats
    rests: AtRest | None = None

    @cached_property
    def command(self) -> Floats:
        """The commanded force with its mean, shape (N,): an actuator's laws are of zero force."""
        return self.recording.force

    @cached_property
    def _measured(self) -> Floats:
        return _between(self.recording.position)

    @cached_property
    def edge_hz(self) -> float:
        """Up to where a hand's motion is read off the encoder."""
        return hand_edge_hz(self.recording.position, self.recording.period_s)

    @cached_property
    def resting(self) -> Simulation | None:
        """With the force of friction at rest told from how smoothly a hand moves.

        None without a hand, or without rests.
        """
        if not self.model.held:
            return None
        rests = at_rest(self.recording, self.model.system(self.usual), self.edge_hz)
        return None if rests is None else replace(self, rests=rests)

    @cached_property
    def _usual_coasting(self) -> Floats:
        return remembered(self._coasting(self.usual))

    def _coasting(self, theta: Floats) -> Floats:
        return coasting_motions(
            self.model.system(theta), self.recording.samples, self.recording.period_s
        )

    def motions(self, theta: Floats, places: tuple[Place, ...]) -> dict[Place, Motion]:
        """Position and velocity at places, on the fine grid, beside the forces that are there."""
        arriving = self.arriving(())
        linear = self._linear(theta, arriving, places)
        left = self._left(theta, arriving, linear)
        taken = self._besides(theta, places).of(left - self.there)
        return self._moving(theta, places, linear, taken)

    def added(
        self, forces: tuple[Acting, ...], theta: Floats, expected: Floats | None = None
    ) -> Floats:
        """What each force adds to the motor's position at the samples, shape (F, N).

        nan where the mass runs away with them, as one does behind a spring that softens too much.
        An actuator's adds nothing: it takes some of the command away.

        Parameters
        ----------
        forces : tuple of Acting
        theta : ndarray, shape (P,)
            Linear parameters beside them.
        expected : ndarray, shape (N,), optional
            What they may be expected to add together, where something is known of that.
        """

        def added(_: NDArray[np.bool_]) -> Floats:
            besides, left, forced = self._with(forces, theta)
            if expected is None:
                first = besides.begin(left)
            else:
                first = besides.of(left - expected)
            return settled(besides, left, forced, first)

        return self._each(forces, added)

    def added_near(self, forces: tuple[Acting, ...], theta: Floats, near: Floats) -> Floats:
        """What forces add, to first order in how that differs from `near`, shapes (F, N)."""
        return self._each(forces, lambda own: one_step(*self._with(forces, theta), near[own]))

    def _each(
        self, forces: tuple[Acting, ...], added: Callable[[NDArray[np.bool_]], Floats]
    ) -> Floats:
        """With no motion for those that move no mass."""
        every = np.zeros((len(forces), self.recording.samples))
        own = np.array([one.moves_a_mass for one in forces], bool)
        if own.any():
            every[own] = added(own)
        return every

    def lost(self, forces: tuple[Acting, ...]) -> Floats:
        """What of the command does not arrive, shape (N,)."""
        lost = np.zeros_like(self.command)
        for one in forces:
            if isinstance(one.effect, CommandEffect):
                lost = lost + one.effect.lost(one.strength, self.command - lost)
        return lost

    def arriving(self, forces: tuple[Acting, ...]) -> Floats:
        """What of the command arrives, without its mean, shape (N,)."""
        arriving = self.command - self.lost(forces)
        return arriving - arriving.mean()

    def driven(self, forces: tuple[Acting, ...], theta: Floats, added: Floats) -> Floats:
        """The sum of motions added, and what an actuator's forces do by the command's lack."""
        total = np.asarray(added.sum(axis=0))
        if all(one.moves_a_mass for one in forces):
            return total
        system, period = self.model.system(theta), self.recording.period_s
        return np.asarray(total - linear_motion(system, self.lost(forces), period)[0])

    def _with(
        self, forces: tuple[Acting, ...], theta: Floats
    ) -> tuple[Besides, Floats, Callable[[Floats], Floats]]:
        """What forces are simulated with.

        What nothing known makes, the measured position less what the command does, and from a
        motion of the first kind to what each force that moves a mass adds.
        """
        acting = [one for one in forces if one.moves_a_mass]
        order = sorted(range(len(acting)), key=lambda i: acting[i].effect.sticks)
        places = _places(acting)
        laws = [one.effect.law(one.strength, self.model, theta) for one in acting]
        arriving, system = self.arriving(forces), self.model.system(theta)
        linear = self._linear(theta, arriving, places)
        left, mechanism = self._left(theta, arriving, linear), system.mechanism
        period, away = self.recording.period_s, 1e3 * np.ptp(self.recording.position)

        def forced(taken: Floats) -> Floats:
            step = 4.0  # what one costs, with the motion around it, in values of a rational model
            spend(step * SUBSTEPS * len(left) * len(acting))
            motion = self._moving(theta, places, linear, taken)
            drawn = left - taken if self.model.held else left
            internal = []
            for i in order:
                there = motion[acting[i].effect.place]
                seen = _between(correction(drawn, period)) if laws[i].observed else 0.0
                position = there.position + seen
                internal.append(Internal(acting[i].effect.place, laws[i], position, there.velocity))
            added = np.empty((len(acting), len(left)))
            moved = forced_motion(mechanism, internal, period / SUBSTEPS, SUBSTEPS)
            added[order] = in_time(system.sensing, moved, period)
            return added if np.all(np.abs(added) < away) else np.full_like(added, np.nan)

        return self._besides(theta, places), left, forced

    def _besides(self, theta: Floats, places: tuple[Place, ...]) -> Besides:
        """What neither command nor forces make."""
        if self.model.held:
            own, usual = self.model.system(theta), self.model.system(self.usual)
            kind = Hand if _against_ground(places) else HandAfar
            return kind(self.recording.period_s, self.edge_hz, own, usual, self.rests)
        if not _against_ground(places):
            return Nothing()  # that a spring between the masses would know of
        kept, mean = self._usual_coasting.shape[1], float(self.recording.force.mean())
        return Coasting(self._coasting(theta)[:, :kept], self._usual_coasting, mean)

    def _linear(self, theta: Floats, command: Floats, places: tuple[Place, ...]) -> Floats:
        """What a command does to the masses at places: positions and velocities, (M, 2, N * s).

        Of the motor always, on the fine grid.
        """
        system = self.model.system(theta).of_masses
        # The second mass of a rigid device is that of a vibration mode.
        both = {LOAD, CONNECTION} & set(places) and "kc" in self.model.names
        masses = (0, 1) if both else (0,)
        return linear_motions(system, command, self.recording.period_s, masses, SUBSTEPS)

    def _left(self, theta: Floats, command: Floats, linear: Floats) -> Floats:
        """The measured position less what a command does to it, (N,)."""
        own, system = linear[0, 0, ::SUBSTEPS], self.model.system(theta)
        if system.sensing:
            own = linear_motion(system, command, self.recording.period_s)[0]
        return np.asarray(self.recording.position - own)

    def _moving(
        self, theta: Floats, places: tuple[Place, ...], linear: Floats, taken: Floats
    ) -> dict[Place, Motion]:
        """Motion at places, with that which nothing known makes, `taken`."""
        (x, v), *others = linear
        found = {}
        if _against_ground(places):
            # The measured position has what a hand does, and where the device stands.
            along = _between(np.gradient(taken, self.recording.period_s))
        if MOTOR in places:
            found[MOTOR] = Motion(self._measured, v + along, self.command)
        for x2, v2 in others:
            if LOAD in places:  # what is slow moves both masses
                found[LOAD] = Motion(x2, v2 + along, self.command)
            if CONNECTION in places:
                hangs = self._hanging_back(taken, theta)
                found[CONNECTION] = Motion(x - x2 + hangs, v - v2, self.command)
        return found

    def _hanging_back(self, taken: Floats, theta: Floats) -> Floats | float:
        """How far the motor hangs back where a hand moves the device."""
        if not self.model.held:
            return 0.0
        values = dict(zip(self.model.names, theta.tolist(), strict=True))
        return _between(stretched(taken, self.recording.period_s, values))


def _places(forces: Sequence[Acting]) -> tuple[Place, ...]:
    return tuple(dict.fromkeys(one.effect.place for one in forces))


def _against_ground(places: tuple[Place, ...]) -> bool:
    """Whether a force acts between a mass and the ground at any of them."""
    return MOTOR in places or LOAD in places


def _between(samples: Floats) -> Floats:
    """Along cubics through four samples each to the fine grid, shape (N * SUBSTEPS,)."""
    t = np.arange(SUBSTEPS) / SUBSTEPS
    before, first = -t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2
    last, after = -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6
    four = np.lib.stride_tricks.sliding_window_view(np.pad(samples, (1, 2), mode="edge"), 4)
    return np.asarray(four @ np.stack([before, first, last, after])).ravel()
