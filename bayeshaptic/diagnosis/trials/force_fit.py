"""Fitting a force's strength and shape together with the linear parameters.

Around the present force its motion is linear in the logarithms of strength and shape: their slopes,
simulated, enter the likelihood as further inputs, and one Gauss-Newton fit moves everything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.state import FIT, share
from bayeshaptic.diagnosis.trials.force_bench import ForceBench, Point
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.inference.fit import search_box
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

_NO_GAIN, _SHARE = 0.5, 1e-3  # of the log likelihood, and of what the force gains in all
_ON, _BACK = 2.0, 0.3  # factors on a step that goes well, and on one that does not
_NUDGE = 0.1  # relative, of strength and shape for the slopes
_SDS, _LEAST, _FARTHEST = 5.0, 3e-3, 0.1  # the same of a linear parameter
_NEAREST, _NEAR = 0.1, 0.5  # least share of these distances, and what counts as a small one
_MOST = 0.8  # log change a round


@dataclass(frozen=True)
class _Form:
    """What of a force is fitted: the logarithms of its strength and of its tuned shape."""

    effect: NonlinearEffect
    sign: float
    highest: Floats
    """The largest logarithms, shape (1 + shape,)."""

    @classmethod
    def of(cls, found: Point) -> _Form:
        bounds = [found.effect.most.get(name, np.inf) for name in found.effect.tuned]
        return cls(found.effect, float(np.sign(found.strength)), np.log([np.inf, *bounds]))

    def logs(self, found: Point) -> Floats:
        shape = [found.effect.shape[name] for name in self.effect.tuned]
        return np.asarray(np.log([abs(found.strength), *shape]))

    def at(self, logs: Floats) -> tuple[NonlinearEffect, float]:
        """The effect and its strength."""
        logs = np.minimum(logs, self.highest)
        tuned = zip(self.effect.tuned, np.exp(logs[1:]).tolist(), strict=True)
        shaped = replace(self.effect, shape={**self.effect.shape, **dict(tuned)})
        return shaped, self.sign * float(np.exp(logs[0]))


@dataclass(frozen=True)
class _Step:
    """Where to go: the linear parameters there, and the change of the logarithms."""

    theta: Floats
    logs: Floats

    @property
    def size(self) -> float:
        return float(np.abs(self.logs).max())


def fit_force(bench: ForceBench, found: Point) -> Point:
    """The best force of the law near `found`, or `found` where nothing is better.

    Parameters
    ----------
    bench : ForceBench
    found : Point
        The best of a coarse scan.

    Returns
    -------
    Point
    """
    form = _Form.of(found)
    first, best = form.logs(found), found
    nudges, near, failed = _nudges(bench), 1.0, False
    rounds = 12
    for _ in range(rounds):
        logs = form.logs(best)
        step = _joint_step(bench, form, logs, best.theta, logs - first, nudges, near)
        factor, point = _advanced(bench, form, best, step)
        gained = point.gain_fit - best.gain_fit
        best = point if gained > 0 else best
        enough = max(_NO_GAIN, _SHARE * best.gain_fit)
        if gained < enough and failed:
            break
        failed = gained < enough
        if failed:  # once more, with slopes over another distance
            near = min(_ON * near, 1.0) if near < _NEAR else _BACK
        else:  # slopes over no more than what is still to go
            near = float(np.clip(factor * step.size / _NUDGE, _NEAREST, 1.0))
    return best


def _advanced(bench: ForceBench, form: _Form, best: Point, step: _Step) -> tuple[float, Point]:
    """The best point found along `step` from `best`, and how many steps away it is."""
    here, low, high = search_box(bench.model)
    start, end = here.coordinate(np.stack([best.theta, step.theta]))
    logs = form.logs(best)

    def along(factor: float) -> Point:
        phi = np.clip(start + factor * (end - start), low, high)
        return bench.as_it_is(*form.at(logs + factor * step.logs), here.natural(phi[None])[0])

    factor, point = 1.0, along(1.0)
    if point.gain_fit < best.gain_fit:
        for factor in (_BACK, _BACK**2):
            polished = bench.point(*form.at(logs + factor * step.logs), best.theta, rounds=2)
            point = max(along(factor), polished, key=lambda point: point.gain_fit)
            if point.gain_fit > best.gain_fit:
                break
        return factor, point
    # Slopes of a motion that sticks are rough, and steps along a ridge too short.
    while factor * step.size < _MOST / _ON:
        further = along(_ON * factor)
        if further.gain_fit < point.gain_fit + _NO_GAIN:
            break
        factor, point = _ON * factor, further
    polished = bench.point(point.effect, point.strength, point.theta)
    return factor, max(point, polished, key=lambda point: point.gain_fit)


def _nudges(bench: ForceBench) -> Floats:
    """How far each linear parameter goes for the slopes of the motion: some standard deviations.

    Less would see how a sticking mass jumps, not where it goes; more would leave a resonance.
    """
    fit = bench.state.fit
    here, _, _ = search_box(bench.model)
    relative = fit.sd / np.where(here.log, np.maximum(fit.theta, 1e-300), here.scale)
    return np.clip(np.nan_to_num(_SDS * relative, nan=np.inf), _LEAST, _FARTHEST)


def _joint_step(
    bench: ForceBench,
    form: _Form,
    logs: Floats,
    theta: Floats,
    moved: Floats,
    nudges: Floats,
    near: float,
) -> _Step:
    """To the linear parameters, strength and shape that fit best together.

    `near` is the share of the usual distances to take the slopes over.
    """

    def motion(logs: Floats, theta: Floats) -> Floats:
        return bench.added_motion(*form.at(logs), theta)

    extra = motion(logs, theta)
    bench.remember(extra)
    sides = near * np.where(np.isfinite(form.highest), -_NUDGE, _NUDGE)  # away from a bound
    slopes = [
        (motion(logs + side * unit, theta) - extra) / side
        for side, unit in zip(sides, np.eye(len(logs)), strict=True)
    ]
    # The motor's motion under a hand is mostly measured: it hardly depends on the parameters.
    if form.effect.place != MOTOR or not bench.held:
        here, _, _ = search_box(bench.model)
        nudges = near * nudges
        around = here.natural(here.coordinate(theta[None]) + np.diag(nudges))
        slopes += [
            (motion(logs, vector) - extra) / nudge
            for vector, nudge in zip(around, nudges, strict=True)
        ]
    slopes = [slope if np.isfinite(slope[0]) else np.zeros_like(slope) for slope in slopes]
    etfe = bench.without(*form.at(logs), extra)
    windows = bench.windows(etfe, theta, slopes)
    # The many slopes leave too little of a window to read its noise from.
    noise = Likelihood(bench.model, bench.windows(etfe, theta)).noise_variance
    chosen = share(windows, FIT)
    return _solved(bench, windows.part(chosen), noise[chosen], theta, moved, form.highest - logs)


def _solved(
    bench: ForceBench,
    windows: Windows,
    noise: Floats,
    theta: Floats,
    moved: Floats,
    room: Floats,
) -> _Step:
    """The step from windows that have the slopes as further inputs.

    Strength and shape have moved by the logarithms `moved` so far, and may by up to `room`.
    """
    here, low, high = search_box(bench.model)
    size, inputs = bench.model.size, len(moved)
    nodes = windows.frequency_hz.shape[1]
    columns = windows.design[:, :, nodes:]
    linear = columns.shape[2] > inputs  # whether the motion's slopes in phi are among them
    own = Likelihood(bench.model, replace(windows, design=windows.design[:, :, :nodes]))
    weight = np.sqrt(2 / noise)[:, None]

    shape_sd = 1.0  # log; how far a shape may be from the grid's

    def residuals(phi: Floats) -> Floats:
        steps = phi[:, size:]
        if linear:
            steps = np.concatenate([steps, phi[:, :size] - start[:, :size]], axis=1)
        left = own.deviations(here.natural(phi[:, :size]))
        left = (left - np.einsum("wrj,bj->bwr", columns, steps)) * weight
        flat = left.reshape(len(phi), -1)
        far = (moved + phi[:, size:])[:, 1:] / shape_sd
        return np.concatenate([flat.real, flat.imag, far], axis=1)

    start = np.concatenate([here.coordinate(theta[None])[0], np.zeros(inputs)])[None]
    low = np.concatenate([low, np.full(inputs, -_MOST)])
    high = np.concatenate([high, np.minimum(room, _MOST)])
    phi, _ = minimise(residuals, start, low, high, 20, 1e-4)
    return _Step(np.asarray(here.natural(phi[:, :size])[0]), phi[0, size:])
