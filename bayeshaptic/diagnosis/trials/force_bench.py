"""One recording and one linear model, on which internal forces are tried.

What a force adds to the motion is simulated and taken off the recording; the linear parameters are
fitted to what is left.  What goes into the law is the simulated motion, without encoder noise;
taking sign(v) from the encoder would miss half of the friction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.diagnosis.residuals.columns import drift_velocity, line_transform
from bayeshaptic.diagnosis.state import State, fit_part, log_likelihoods
from bayeshaptic.effects.nonlinear.internal_force import (
    CONNECTION,
    LOAD,
    MOTOR,
    Place,
    forced_motion,
)
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, Motion, NonlinearEffect
from bayeshaptic.models.response.motion import linear_motion, linear_motions
from bayeshaptic.numerics.spending import spend
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

SUBSTEPS = 8


@dataclass(frozen=True)
class Point:
    """What one force gives.

    Attributes
    ----------
    effect : NonlinearEffect
    strength : float
    theta : ndarray, shape (P,)
        Linear parameters fitted beside it.
    etfe : Etfe
        Less the motion that the force adds.
    windows : Windows
    gain_fit, gain_choose : float
        Gain in log likelihood on the windows to fit and on those to choose by.
    """

    effect: NonlinearEffect
    strength: float
    theta: Floats
    etfe: Etfe
    windows: Windows
    gain_fit: float
    gain_choose: float


class ForceBench:
    """Simulates forces, and fits what they leave.

    Parameters
    ----------
    state : State
    recording : Recording
    """

    def __init__(self, state: State, recording: Recording) -> None:
        self.state = state
        self.model = state.model
        self.held = self.model.held
        self.recording = recording
        self.force = recording.force - recording.force.mean()
        self._transform = line_transform(state.etfe, recording)
        self._extra: Floats = np.zeros(recording.samples)
        self._measured = _between(recording.position)
        self._base = self._likelihoods(state.fit.theta, state.fit.windows)

    def motions(self, theta: Floats, places: tuple[Place, ...]) -> dict[Place, Motion]:
        """Position and velocity at places, on the fine grid, without the force."""
        system, period = self.model.system(theta), self.recording.period_s
        masses = tuple(range(min(len(system.mechanism.masses), 2)))
        if set(places) == {MOTOR}:
            masses = masses[:1]
        (x, v), *others = linear_motions(system, self.force, period, masses, SUBSTEPS)
        found = {}
        along: Floats | float = 0.0
        if {MOTOR, LOAD} & set(places):
            # The measured position has what a hand does, and where the device stands.
            measured = self.recording.position
            besides = measured - x[::SUBSTEPS] - self._extra
            along = _between(self._hand(besides) if self.held else self._drift(besides, theta))
            found[MOTOR] = Motion(self._measured, v + along, self.force)
        for x2, v2 in others:
            found[CONNECTION] = Motion(x - x2, v - v2, self.force)
            if LOAD in places:  # what is slow moves both masses
                found[LOAD] = Motion(x2, v2 + along, self.force)
        return found

    def _hand(self, besides: Floats) -> Floats:
        """Velocity that a hand adds: what is slow, because there the encoder sees it well."""
        rate = 1 / self.recording.period_s
        hand_hz = 20.0
        low = butter(2, min(hand_hz, 0.4 * rate), fs=rate, output="sos")
        return np.gradient(sosfiltfilt(low, besides), 1 / rate)

    def _drift(self, besides: Floats, theta: Floats) -> Floats:
        """Velocity of a free device from how it began and from a constant force."""
        return drift_velocity(self.model.system(theta), besides, self.recording.period_s)

    def added_motion(self, effect: NonlinearEffect, strength: float, theta: Floats) -> Floats:
        """What the force adds to the motor's position at the samples, shape (N,).

        nan where the mass runs away with it, as one does behind a spring that softens too much.
        """
        system, period = self.model.system(theta), self.recording.period_s
        if isinstance(effect, CommandEffect):
            return linear_motion(system, effect.lost(strength, self.force), period)[0] * -1.0
        step = 4.0  # what a step costs, with the motion around it, in values of a rational model
        spend(step * SUBSTEPS * self.recording.samples)
        motion = self.motions(theta, (effect.place,))[effect.place]
        added = forced_motion(
            system.mechanism,
            effect.place,
            effect.law(strength, self.model, theta),
            motion.position,
            motion.velocity,
            period / SUBSTEPS,
            SUBSTEPS,
        )
        away = 1e3  # times the range of what was measured
        stays = np.abs(added) < away * np.ptp(self.recording.position)
        return added if np.all(stays) else np.full_like(added, np.nan)

    def remember(self, extra: Floats) -> None:
        """Take this for what the force adds, when the slow motion is read off the encoder.

        Not a motion that ran away (nan): with it every law after it would, too.
        """
        if np.isfinite(extra[0]):
            self._extra = extra

    def point(
        self, effect: NonlinearEffect, strength: float, theta: Floats, rounds: int = 1
    ) -> Point:
        """Simulate, take off, fit; several times over, because the fit changes the motion."""
        for _ in range(rounds):
            found = self._simulated(effect, strength, theta)
            if found is None:
                break
            theta = fit_part(self.model, found[1], theta)
        return self._valued(effect, strength, theta, found)

    def as_it_is(self, effect: NonlinearEffect, strength: float, theta: Floats) -> Point:
        """Simulate and take off, with the linear parameters as given."""
        return self._valued(effect, strength, theta, self._simulated(effect, strength, theta))

    def without(self, effect: NonlinearEffect, strength: float, extra: Floats) -> Etfe:
        """The measurement without what a force does: the motion `extra`, or of the command less."""
        own, spectra = self.recording, self.state.etfe.spectra
        if isinstance(effect, CommandEffect):
            lost = effect.lost(strength, self.force)
            force = spectra.force - self._transform(lost)  # type: ignore[attr-defined]
            own = replace(own, force=own.force - lost)
            spectra = replace(spectra, force=force)  # type: ignore[call-arg, type-var]
        else:
            position = spectra.position - self._transform(extra)  # type: ignore[attr-defined]
            own = replace(own, position=own.position - extra)
            spectra = replace(spectra, position=position)  # type: ignore[call-arg, type-var]
        return replace(self.state.etfe, spectra=spectra, recording=own)

    def windows(self, etfe: Etfe, theta: Floats, columns: list[Floats] | None = None) -> Windows:
        """Windows of a measurement, with motions as further inputs."""
        inputs = np.stack([self._transform(column) for column in columns]) if columns else None
        return compress(etfe, partial(self.model.response, theta), inputs)

    def _simulated(
        self, effect: NonlinearEffect, strength: float, theta: Floats
    ) -> tuple[Etfe, Windows] | None:
        """The measurement without what the force adds, and its windows; None where it runs away."""
        if not isinstance(effect, CommandEffect):  # that adds no motion
            added = self.added_motion(effect, strength, theta)
            if np.isnan(added[0]):
                return None
            self._extra = added
        etfe = self.without(effect, strength, self._extra)
        return etfe, self.windows(etfe, theta)

    def _valued(
        self,
        effect: NonlinearEffect,
        strength: float,
        theta: Floats,
        found: tuple[Etfe, Windows] | None,
    ) -> Point:
        if found is None:  # nothing that runs away explains what was measured
            state = self.state
            return Point(effect, strength, theta, state.etfe, state.fit.windows, -np.inf, -np.inf)
        gains = self._likelihoods(theta, found[1]) - self._base
        return Point(effect, strength, theta, *found, float(gains[0]), float(gains[1]))

    def _likelihoods(self, theta: Floats, windows: Windows) -> Floats:
        return log_likelihoods(self.model, windows, theta)


def _between(samples: Floats) -> Floats:
    """Along straight lines to the fine grid, the last sample held, shape (N * SUBSTEPS,)."""
    ahead = np.append(samples[1:], samples[-1])
    weight = np.arange(SUBSTEPS) / SUBSTEPS
    return np.asarray(np.stack([samples, ahead], axis=1) @ np.stack([1 - weight, weight])).ravel()
