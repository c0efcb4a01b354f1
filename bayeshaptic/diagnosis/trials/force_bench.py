"""One recording and one linear model, on which internal forces are tried.

What forces add to the motion is simulated and taken off the recording; the linear parameters are
fitted to what is left.  What goes into the laws is the simulated motion, without encoder noise;
taking sign(v) from the encoder would miss half of the friction.  Forces that were found before are
put back and simulated with the one that is tried: each acts in the motion that all of them make,
and what one was taken for may be another's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.diagnosis.residuals.columns import drift_velocity, line_transform
from bayeshaptic.diagnosis.state import Change, State, fit_part, log_likelihoods
from bayeshaptic.diagnosis.trials.taken_off import with_forces
from bayeshaptic.effects.nonlinear.internal_force import (
    CONNECTION,
    LOAD,
    MOTOR,
    Internal,
    Place,
    forced_motion,
)
from bayeshaptic.effects.nonlinear.observer import correction, stretched
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, Motion, NonlinearEffect
from bayeshaptic.models.response.motion import linear_motion, linear_motions
from bayeshaptic.numerics.spending import spend
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

SUBSTEPS = 8

_Simulated = tuple[tuple[Change, ...], Etfe, Windows]


@dataclass(frozen=True)
class Point:
    """What forces give.

    Attributes
    ----------
    forces : tuple of Acting
        Those that were found before, and the one that is tried.
    theta : ndarray, shape (P,)
        Linear parameters fitted beside them.
    changes : tuple of Change
        What each of them takes off the recording.
    etfe : Etfe
        Less that.
    windows : Windows
    gain_fit, gain_choose : float
        Gain in log likelihood on the windows to fit and on those to choose by.
    """

    forces: tuple[Acting, ...]
    theta: Floats
    changes: tuple[Change, ...]
    etfe: Etfe
    windows: Windows
    gain_fit: float
    gain_choose: float

    @property
    def effect(self) -> NonlinearEffect:
        """The one that is tried."""
        return self.forces[-1].effect

    @property
    def strength(self) -> float:
        """Of the one that is tried."""
        return self.forces[-1].strength


class ForceBench:
    """Simulates forces, and fits what they leave.

    Parameters
    ----------
    state : State
    recording : Recording

    Attributes
    ----------
    before : tuple of Acting
        The forces of the state, which act beside what is tried.
    frequency_hz : ndarray, shape (L,)
        The lines of the spectra.
    at_lines : callable
        A signal, shape (N,), to its DFT there.
    extra : ndarray, shape (N,)
        What forces are taken to add when the slow motion is read off the encoder.
    """

    def __init__(self, state: State, recording: Recording) -> None:
        self.state = state
        self.model = state.model
        self.held = self.model.held
        there = [e.change for e in state.accepted if e.change and e.change.acting]
        self.before = tuple(change.acting for change in there if change.acting)
        self._etfe = with_forces(replace(state.etfe, recording=recording), there)
        assert self._etfe.recording is not None
        self.recording = self._etfe.recording
        self.force = self.recording.force - self.recording.force.mean()
        self.frequency_hz: Floats = state.etfe.spectra.frequency_hz  # type: ignore[attr-defined]
        self.at_lines: Callable[[Floats], Complexes] = line_transform(state.etfe, recording)
        self.extra: Floats = np.zeros(recording.samples) + sum(c.motion for c in there)
        self._somewhere = state.fit.windows.frequency_hz.mean(axis=1)
        self._measured = _between(self.recording.position)
        self._base = self._likelihoods(state.fit.theta, state.fit.windows)

    def motions(
        self, theta: Floats, places: tuple[Place, ...], command: Floats | None = None
    ) -> dict[Place, Motion]:
        """Position and velocity at places, on the fine grid, without forces."""
        command = self.force if command is None else command
        system, period = self.model.system(theta), self.recording.period_s
        masses = tuple(range(min(len(system.mechanism.masses), 2)))
        if set(places) == {MOTOR} or "kc" not in self.model.names:
            masses = masses[:1]  # the second of a rigid device is that of a vibration mode
        (x, v), *others = linear_motions(system, command, period, masses, SUBSTEPS)
        found = {}
        along: Floats | float = 0.0
        # The measured position has what a hand does, and where the device stands.
        besides = self.recording.position - x[::SUBSTEPS] - self.extra
        if {MOTOR, LOAD} & set(places):
            along = _between(self._hand(besides) if self.held else self._drift(besides, theta))
            found[MOTOR] = Motion(self._measured, v + along, command)
        for x2, v2 in others:
            found[CONNECTION] = Motion(x - x2 + self._stretched(besides, theta), v - v2, command)
            if LOAD in places:  # what is slow moves both masses
                found[LOAD] = Motion(x2, v2 + along, command)
        return found

    def _hand(self, besides: Floats) -> Floats:
        """Velocity that a hand adds: what is slow, because there the encoder sees it well."""
        return np.gradient(self._slow(besides), self.recording.period_s)

    def _slow(self, besides: Floats) -> Floats:
        """Position that a hand adds."""
        rate = 1 / self.recording.period_s
        hand_hz = 20.0
        low = butter(2, min(hand_hz, 0.4 * rate), fs=rate, output="sos")
        return np.asarray(sosfiltfilt(low, besides))

    def _stretched(self, besides: Floats, theta: Floats) -> Floats | float:
        """How far the motor hangs back where a hand moves the device."""
        if not self.held:
            return 0.0
        values = dict(zip(self.model.names, theta.tolist(), strict=True))
        return _between(stretched(self._slow(besides), self.recording.period_s, values))

    def _corrected(self, theta: Floats, command: Floats) -> Floats:
        """How far the measurement draws the motion in the connection, but for what forces do."""
        period = self.recording.period_s
        x = linear_motion(self.model.system(theta), command, period)[0]
        driven = self.recording.position - x
        slow = self._slow(driven - self.extra) if self.held else 0.0
        return _between(correction(driven - slow, period))

    def _drift(self, besides: Floats, theta: Floats) -> Floats:
        """Velocity of a free device from how it began and from a constant force."""
        return drift_velocity(self.model.system(theta), besides, self.recording.period_s)

    def added_motions(self, forces: tuple[Acting, ...], theta: Floats) -> Floats:
        """What each force adds to the motor's position at the samples, shape (F, N).

        nan where the mass runs away with them, as one does behind a spring that softens too much.
        An actuator's adds nothing: it takes some of the command away.
        """
        inner = [i for i, one in enumerate(forces) if not isinstance(one.effect, CommandEffect)]
        added = np.zeros((len(forces), self.recording.samples))
        if not inner:
            return added
        inner.sort(key=lambda i: forces[i].effect.sticks)
        step = 4.0  # what a step costs, with the motion around it, in values of a rational model
        spend(step * SUBSTEPS * self.recording.samples * len(inner))
        places = tuple(dict.fromkeys(forces[i].effect.place for i in inner))
        command = self.force - self.lost(forces)
        motion = self.motions(theta, places, command)
        acting = []
        for i in inner:
            effect = forces[i].effect
            law, there = effect.law(forces[i].strength, self.model, theta), motion[effect.place]
            seen = there.position + (self._corrected(theta, command) if law.observed else 0.0)
            acting.append(Internal(effect.place, law, seen, there.velocity))
        period = self.recording.period_s
        mechanism = self.model.system(theta).mechanism
        added[inner] = forced_motion(mechanism, acting, period / SUBSTEPS, SUBSTEPS)
        away = 1e3  # times the range of what was measured
        stays = np.abs(added) < away * np.ptp(self.recording.position)
        return added if np.all(stays) else np.full_like(added, np.nan)

    def stays(self, forces: tuple[Acting, ...], theta: Floats) -> bool:
        """Whether the mass does not run away with forces."""
        return bool(np.isfinite(self.added_motions(forces, theta)).all())

    def lost(self, forces: tuple[Acting, ...]) -> Floats:
        """What of the command does not arrive, shape (N,)."""
        lost = np.zeros_like(self.force)
        for one in forces:
            if isinstance(one.effect, CommandEffect):
                lost = lost + one.effect.lost(one.strength, self.force - lost)
        return lost

    def driven(self, forces: tuple[Acting, ...], theta: Floats, added: Floats) -> Floats:
        """The sum of motions added, and what an actuator's forces do by the command's lack."""
        lacking = any(isinstance(one.effect, CommandEffect) for one in forces)
        if not lacking:
            return np.asarray(added.sum(axis=0))
        system, period = self.model.system(theta), self.recording.period_s
        return np.asarray(added.sum(axis=0) - linear_motion(system, self.lost(forces), period)[0])

    def remember(self, extra: Floats) -> None:
        """Take this for what forces add, when the slow motion is read off the encoder.

        Not a motion that ran away (nan): with it every law after it would, too.
        """
        if np.isfinite(extra[0]):
            self.extra = extra

    def point(self, forces: tuple[Acting, ...], theta: Floats, rounds: int = 1) -> Point:
        """Simulate, take off, fit; several times over, because the fit changes the motion."""
        for _ in range(rounds):
            found = self._simulated(forces, theta)
            if found is None:
                break
            theta = fit_part(self.model, found[-1], theta)
        return self._valued(forces, theta, found)

    def as_it_is(self, forces: tuple[Acting, ...], theta: Floats) -> Point:
        """Simulate and take off, with the linear parameters as given."""
        return self._valued(forces, theta, self._simulated(forces, theta))

    def without(self, changes: Sequence[Change]) -> Etfe:
        """The measurement without what forces do."""
        return with_forces(self._etfe, changes, -1.0)

    def changes(self, forces: tuple[Acting, ...], added: Floats) -> tuple[Change, ...]:
        """What each force takes off the recording, of the motions that they add, (F, N)."""
        found, command = [], self.force
        for one, motion in zip(forces, added, strict=True):
            if isinstance(one.effect, CommandEffect):
                lost = one.effect.lost(one.strength, command)
                command = command - lost
                found.append(Change(None, one, self.at_lines(lost), 0.0, lost, 0.0))
            else:
                found.append(Change(None, one, 0.0, self.at_lines(motion), 0.0, motion))
        return tuple(found)

    def windows(self, etfe: Etfe, theta: Floats, columns: list[Complexes] | None = None) -> Windows:
        """Windows of a measurement, with motions, at its lines, as further inputs."""
        inputs = np.stack(columns) if columns else None
        return compress(etfe, partial(self.model.response, theta), inputs)

    def _simulated(self, forces: tuple[Acting, ...], theta: Floats) -> _Simulated | None:
        """What forces do, the measurement without it and its windows.

        None where it runs away, or where the linear parameters are such that no response is a
        number (a damper at zero behind a spring a thousand times too stiff).
        """
        if not np.all(np.isfinite(self.model.response(theta, self._somewhere))):
            return None
        added = self.added_motions(forces, theta)
        if np.isnan(added).any():
            return None
        self.extra = added.sum(axis=0)
        changes = self.changes(forces, added)
        etfe = self.without(changes)
        return changes, etfe, self.windows(etfe, theta)

    def _valued(self, forces: tuple[Acting, ...], theta: Floats, found: _Simulated | None) -> Point:
        if found is None:  # nothing that runs away explains what was measured
            state = self.state
            return Point(forces, theta, (), state.etfe, state.fit.windows, -np.inf, -np.inf)
        gains = self._likelihoods(theta, found[-1]) - self._base
        return Point(forces, theta, *found, float(gains[0]), float(gains[1]))

    def _likelihoods(self, theta: Floats, windows: Windows) -> Floats:
        return log_likelihoods(self.model, windows, theta)


def _between(samples: Floats) -> Floats:
    """Along cubics through four samples each to the fine grid, shape (N * SUBSTEPS,)."""
    t = np.arange(SUBSTEPS) / SUBSTEPS
    before, first = -t * (t - 1) * (t - 2) / 6, (t + 1) * (t - 1) * (t - 2) / 2
    last, after = -(t + 1) * t * (t - 2) / 2, (t + 1) * t * (t - 1) / 6
    four = np.lib.stride_tricks.sliding_window_view(np.pad(samples, (1, 2), mode="edge"), 4)
    return np.asarray(four @ np.stack([before, first, last, after])).ravel()
