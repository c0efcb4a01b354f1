"""Trying internal forces: simulate what a force of a given strength adds, take it off, fit again.

The likelihood of a strength is that of the recording less the simulated motion, with the linear
parameters fitted anew: a profile.  What goes into the law is the simulated motion, without encoder
noise; taking sign(v) from the encoder would miss half of the friction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.diagnosis.columns import line_transform
from bayeshaptic.diagnosis.state import (
    CHOOSE,
    FIT,
    Accepted,
    Estimate,
    State,
    Trial,
    describe_gain,
    share,
)
from bayeshaptic.effects.internal_force import CONNECTION, MOTOR, Place, forced_motion
from bayeshaptic.effects.nonlinear import Motion, NonlinearEffect
from bayeshaptic.effects.registry import effects
from bayeshaptic.inference.least_squares import Fit, polish, summarise
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models.motion import linear_motion
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.recordings.etfe import Etfe
from bayeshaptic.recordings.random_excitation import points as points_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.windows import Windows, compress
from bayeshaptic.stability.critical import critical_stiffness

Floats = NDArray[np.float64]

SUBSTEPS = 8
_HAND_HZ = 20.0
_LAW_SD = 0.03  # relative; how well a law and its shape are known at best
_INNER = 3  # fits a strength: the damping that hid the force gives way step by step


@dataclass(frozen=True)
class _Point:
    """What one strength gives."""

    strength: float
    theta: Floats
    etfe: Etfe
    windows: Windows
    gain_fit: float
    gain_choose: float


def nonlinear_trials(
    state: State, raised: set[str], tick: Callable[[str], None] | None = None
) -> list[Trial]:
    """One trial for each nonlinear effect that the raised tests call for; the best of its variants.

    Parameters
    ----------
    state : State
    raised : set of str
        Names of the nonlinear tests that are flagged.
    tick : callable, optional
        Called with the title of each candidate.
    """
    recording = state.etfe.recording
    if recording is None:
        return []
    bench = _Bench(state, recording)
    trials = []
    hints: dict[str, float] = {}  # strengths found so far: laws of friction have similar ones
    for kind in effects("nonlinear"):
        if kind.name in {a.name for a in state.accepted}:
            continue
        motion = bench.motions(state.fit.theta, (MOTOR, CONNECTION))
        called = [e for e in kind.candidates(state.model, motion) if e.called_for(raised)]
        if not called:
            continue
        if tick:
            tick(kind.title)
        found = bench.search(called, motion, hints.get(kind.strength[0]))
        if found and found[1].gain_fit > 10:
            hints.setdefault(kind.strength[0], found[1].strength)
            trials.append(bench.trial(*found))
    return trials


class _Bench:
    """One recording and one linear model, on which forces are tried."""

    def __init__(self, state: State, recording: Recording) -> None:
        self.state = state
        self.recording = recording
        self.force = recording.force - recording.force.mean()
        self.transform = line_transform(state.etfe, recording)
        self.starts: dict[Place, Floats] = {}
        self.extra: Floats = np.zeros(recording.samples)
        self.base = self._likelihoods(state.fit.theta, state.fit.windows)

    def motions(self, theta: Floats, places: tuple[Place, ...]) -> dict[Place, Motion]:
        """Position and velocity at places, on the fine grid, without the force."""
        system = self.state.model.system(theta)
        period = self.recording.period_s
        x, v = linear_motion(system, self.force, period, 0, SUBSTEPS)
        found = {}
        if CONNECTION in places and len(system.mechanism.masses) > 1:
            x2, v2 = linear_motion(system, self.force, period, 1, SUBSTEPS)
            found[CONNECTION] = Motion(x - x2, v - v2)
        if MOTOR in places:
            # The measured position has what a hand does, and where the device stands.
            measured = self.recording.position
            grid, samples = np.arange(len(x)) / SUBSTEPS, np.arange(len(measured))
            if self.state.model.name == "grasped":  # a hand moves it besides the command
                hand = self._slow(measured - x[::SUBSTEPS] - self.extra)
                v = v + np.interp(grid, samples, np.gradient(hand, period))
            found[MOTOR] = Motion(np.interp(grid, samples, measured), v)
        return found

    def _slow(self, rest: Floats) -> Floats:
        rate = 1 / self.recording.period_s
        low = butter(2, min(_HAND_HZ, 0.4 * rate), fs=rate, output="sos")
        return np.asarray(sosfiltfilt(low, rest))

    def trial(self, effect: NonlinearEffect, point: _Point) -> Trial:
        """What the best strength of the best variant would mean."""
        model = self.state.model
        theta = polish(model, point.windows, point.theta)
        fit = summarise(model, point.windows, theta)
        accepted = self._accepted(effect, point, *self._spread(effect, point))
        state = State(_with_points(point.etfe, fit), fit, (*self.state.accepted, accepted))
        size = 1 + len(effect.shape)
        return Trial(accepted, state, point.gain_fit, point.gain_choose, size)

    def search(
        self, variants: list[NonlinearEffect], motion: dict[Place, Motion], hint: float | None
    ) -> tuple[NonlinearEffect, _Point] | None:
        """The best variant, and its best strength.

        Every variant is scanned coarsely; parabolas in log strength close in on the best one.
        """
        scans = []
        for effect in variants:
            firsts = effect.first_strengths(
                self.state.model, self.state.fit.theta, motion[effect.place]
            )
            if hint is not None:
                firsts = hint * np.array([0.7, 1.0])
            points = self._scan(effect, firsts)
            if effect.signed:
                points = max(points, self._scan(effect, -firsts), key=_best_gain)
            scans.append((effect, points))
        effect, points = max(scans, key=lambda scan: _best_gain(scan[1]))
        if _best_gain(points) < 0:
            return None
        for _ in range(7):
            points.sort(key=lambda p: abs(p.strength))
            best = max(range(len(points)), key=lambda i: points[i].gain_fit)
            target = _next_strength(points, best)
            if target is None:
                break
            points.append(self._point(effect, target, points[best].theta))
        return effect, max(points, key=lambda p: p.gain_fit)

    def _scan(self, effect: NonlinearEffect, strengths: Floats) -> list[_Point]:
        """From faint to strong, until it is clearly too strong."""
        points: list[_Point] = []
        for strength in strengths:
            start = points[-1].theta if points else self.state.fit.theta
            points.append(self._point(effect, float(strength), start))
            if len(points) > 1 and points[-1].gain_fit < points[-2].gain_fit - 10:
                break
        return points

    def _point(self, effect: NonlinearEffect, strength: float, theta: Floats) -> _Point:
        """Simulate, take off, fit; a few times over, because the fit changes the motion."""
        model, period = self.state.model, self.recording.period_s
        spectra = self.state.etfe.spectra
        for _ in range(_INNER):
            motion = self.motions(theta, (effect.place,))[effect.place]
            forced = forced_motion(
                model.system(theta).mechanism,
                effect.place,
                effect.law(strength, model, theta),
                motion.position,
                motion.velocity,
                period / SUBSTEPS,
                SUBSTEPS,
                starts=self.starts.get(effect.place),
            )
            self.extra, self.starts[effect.place] = forced.motor_position, forced.starts
            corrected = replace(spectra, position=spectra.position - self.transform(self.extra))  # type: ignore
            etfe = replace(self.state.etfe, spectra=corrected)
            windows = compress(etfe, partial(model.response, theta))
            theta = polish(model, windows.part(share(windows, FIT)), theta)
        own = replace(self.recording, position=self.recording.position - self.extra)
        gains = np.subtract(self._likelihoods(theta, windows), self.base)
        return _Point(
            strength,
            theta,
            replace(etfe, recording=own),
            windows,
            float(gains[0]),
            float(gains[1]),
        )

    def _likelihoods(self, theta: Floats, windows: Windows) -> Floats:
        pointwise = Likelihood(self.state.model, windows).pointwise(theta[None])[0]
        return np.array([pointwise[share(windows, part)].sum() for part in (FIT, CHOOSE)])

    def _spread(self, effect: NonlinearEffect, point: _Point) -> tuple[float, float]:
        """Standard deviations of the strength, and of log K_CR because of it.

        From the curvature of the profile, each side simulated and fitted anew.
        """
        step = 0.03
        low, high = (
            self._point(effect, point.strength * factor, point.theta)
            for factor in (1 - step, 1 + step)
        )
        drop = point.gain_fit - 0.5 * (low.gain_fit + high.gain_fit)
        # Half of the windows were used: the whole recording has twice the information.
        relative = step / np.sqrt(2 * 2 * max(drop, 1e-3))
        # Neither the law nor its shape is known better than this.
        relative = float(np.clip(np.hypot(relative, _LAW_SD), 0.0, 0.5))
        limits = critical_stiffness(self.state.model, np.stack([low.theta, high.theta])).samples
        slope = abs(float(np.log(max(limits[1], 1e-9) / max(limits[0], 1e-9)))) / (2 * step)
        return relative * abs(point.strength), min(slope * relative, 1.0)

    def _accepted(
        self, effect: NonlinearEffect, point: _Point, sd: float, limit_log_sd: float
    ) -> Accepted:
        model = self.state.model
        units = (model.force_unit, model.position_unit)
        name, dimension = effect.strength
        estimates: dict[str, Estimate] = {
            name: Estimate(point.strength, sd, unit_of(dimension, *units))
        }
        for key, value in effect.shape.items():
            estimates[key] = Estimate(value, float("nan"), unit_of(effect.dimensions[key], *units))
        return Accepted(
            effect.name,
            effect.title + _where(effect.place),
            effect.family,
            describe_gain(point.gain_choose),
            estimates,
            told_apart_by=effect.told_apart_by,
            limit_log_sd=limit_log_sd,
        )


def _with_points(etfe: Etfe, fit: Fit) -> Etfe:
    """With what a person sees of it made from its own spectra."""
    found = points_of(etfe.spectra.windows(fit.response))
    return replace(
        etfe,
        frequency_hz=found.frequency_hz,
        value=found.value,
        variance=found.variance,
        coherence=found.coherence,
    )


def _best_gain(points: list[_Point]) -> float:
    return max(point.gain_fit for point in points)


def _where(place: Place) -> str:
    return " in the connection" if place == CONNECTION else " at the motor"


def _next_strength(points: list[_Point], best: int) -> float | None:
    """The peak of the parabola through the best point and its neighbours, in log strength."""
    here = points[best]
    if best == 0:
        return here.strength / 3 if abs(here.strength) > 0 else None
    if best == len(points) - 1:
        return here.strength * 2
    a, b, c = (np.log(abs(points[i].strength)) for i in (best - 1, best, best + 1))
    fa, fb, fc = (points[i].gain_fit for i in (best - 1, best, best + 1))
    top = (b - a) ** 2 * (fb - fc) - (b - c) ** 2 * (fb - fa)
    bottom = (b - a) * (fb - fc) - (b - c) * (fb - fa)
    if bottom == 0:
        return None
    peak = float(np.clip(b - 0.5 * top / bottom, a + 0.1 * (b - a), c - 0.1 * (c - b)))
    if abs(peak - b) < 0.006:
        return None
    return float(np.sign(here.strength) * np.exp(peak))
