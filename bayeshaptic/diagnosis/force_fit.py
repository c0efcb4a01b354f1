"""Fitting a force's strength and shape together with the linear parameters.

Around the present force its motion is linear in the logarithms of strength and shape: their slopes,
simulated, enter the likelihood as further inputs, and one Gauss-Newton fit moves everything.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.force_bench import ForceBench, Point
from bayeshaptic.diagnosis.state import FIT, share
from bayeshaptic.effects.internal_force import MOTOR
from bayeshaptic.effects.nonlinear import NonlinearEffect
from bayeshaptic.inference.gauss_newton import minimise
from bayeshaptic.inference.least_squares import search_box
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.recordings.windows import Windows

Floats = NDArray[np.float64]

_ROUNDS = 12
_NO_GAIN = 0.5  # of the log likelihood
_ON, _BACK = 3.0, 0.3  # factors on a step that goes well, and on one that does not
_NUDGE = 0.1  # relative, of strength and shape for the slopes
_SDS, _LEAST, _FARTHEST = 5.0, 3e-3, 0.1  # the same of a linear parameter
_MOST = 0.8  # log change a round
_SHAPE_SD = 1.0  # log; how far a shape may be from the grid's


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
    effect = found.effect
    names, sign = effect.tuned, float(np.sign(found.strength))
    logs = np.log([abs(found.strength), *(effect.shape[name] for name in names)])
    highest = np.log([np.inf, *(effect.most.get(name, np.inf) for name in names)])
    here, low, high = search_box(bench.model)
    first, best = logs.copy(), found

    def at(logs: Floats) -> tuple[NonlinearEffect, float]:
        return _shaped(effect, names, logs), sign * float(np.exp(logs[0]))

    nudges, near, failed = _nudges(bench), 1.0, False
    for _ in range(_ROUNDS):
        towards, step = _joint_step(bench, at, logs, best.theta, logs - first, near * nudges, highest, near)
        start, end = here.coordinate(np.stack([best.theta, towards]))

        def tried(
            share: float, logs: Floats = logs, step: Floats = step, ends: Floats = (start, end)
        ) -> Point:
            phi = np.clip(ends[0] + share * (ends[1] - ends[0]), low, high)
            moved = np.minimum(logs + share * step, highest)
            return bench.as_it_is(*at(moved), here.natural(phi[None])[0])

        share, point = 1.0, tried(1.0)
        if point.gain_fit < best.gain_fit:
            share = _BACK
            held = bench.point(*at(logs + _BACK * step), best.theta, rounds=2)
            point = max(tried(_BACK), held, key=lambda point: point.gain_fit)
        else:  # slopes of a motion that sticks are rough, and steps along a ridge too short
            while share * np.abs(step).max() < _MOST / _ON:
                further = tried(_ON * share)
                if further.gain_fit < point.gain_fit + _NO_GAIN:
                    break
                share, point = _ON * share, further
            held = bench.point(point.effect, point.strength, point.theta)
            point = max(point, held, key=lambda point: point.gain_fit)
        gained = point.gain_fit - best.gain_fit
        if gained > 0:
            logs, best = np.minimum(logs + share * step, highest), point
        if gained < _NO_GAIN and failed:
            break
        failed = gained < _NO_GAIN
        if failed:
            near = min(_ON*near,1.0) if near < 0.5 else _BACK
        else:
            near = float(np.clip(share * np.abs(step).max() / _NUDGE, 0.1, 1.0))
    return best


def _shaped(effect: NonlinearEffect, names: tuple[str, ...], logs: Floats) -> NonlinearEffect:
    values = {name: float(np.exp(log)) for name, log in zip(names, logs[1:], strict=True)}
    return replace(effect, shape={**effect.shape, **values})


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
    at: Callable[[Floats], tuple[NonlinearEffect, float]],
    logs: Floats,
    theta: Floats,
    moved: Floats,
    nudges: Floats,
    highest: Floats,
    near: float,
) -> tuple[Floats, Floats]:
    """Linear parameters, and the change of log strength and shape, that fit best together."""

    def motion(logs: Floats, theta: Floats) -> Floats:
        return bench.added_motion(*at(logs), theta)

    extra = motion(logs, theta)
    bench.remember(extra)
    sides = near * np.where(np.isfinite(highest), -_NUDGE, _NUDGE)  # away from a bound
    slopes = [
        (motion(logs + side * unit, theta) - extra) / side
        for side, unit in zip(sides, np.eye(len(logs)), strict=True)
    ]
    # The motor's motion under a hand is mostly measured: it hardly depends on the parameters.
    if at(logs)[0].place != MOTOR or not bench.held:
        here, _, _ = search_box(bench.model)
        around = here.natural(here.coordinate(theta[None]) + np.diag(nudges))
        slopes += [
            (motion(logs, vector) - extra) / nudge
            for vector, nudge in zip(around, nudges, strict=True)
        ]
    _, windows = bench.without(extra, theta, slopes)
    # The many slopes leave too little of a window to read its noise from.
    noise = Likelihood(bench.model, bench.without(extra, theta)[1]).noise_variance
    chosen = share(windows, FIT)
    return _solved(bench, windows.part(chosen), noise[chosen], theta, moved, highest - logs)


def _solved(
    bench: ForceBench,
    windows: Windows,
    noise: Floats,
    theta: Floats,
    moved: Floats,
    room: Floats,
) -> tuple[Floats, Floats]:
    """The step from windows that have the slopes as further inputs."""
    here, low, high = search_box(bench.model)
    size, inputs = bench.model.size, len(moved)
    nodes = windows.frequency_hz.shape[1]
    columns = windows.design[:, :, nodes:]
    linear = columns.shape[2] > inputs  # whether the motion's slopes in phi are among them
    own = Likelihood(bench.model, replace(windows, design=windows.design[:, :, :nodes]))
    weight = np.sqrt(2 / noise)[:, None]

    def residuals(phi: Floats) -> Floats:
        steps = phi[:, size:]
        if linear:
            steps = np.concatenate([steps, phi[:, :size] - start[:, :size]], axis=1)
        left = own.deviations(here.natural(phi[:, :size]))
        left = (left - np.einsum("wrj,bj->bwr", columns, steps)) * weight
        flat = left.reshape(len(phi), -1)
        far = (moved + phi[:, size:])[:, 1:] / _SHAPE_SD
        return np.concatenate([flat.real, flat.imag, far], axis=1)

    start = np.concatenate([here.coordinate(theta[None])[0], np.zeros(inputs)])[None]
    low = np.concatenate([low, np.full(inputs, -_MOST)])
    high = np.concatenate([high, np.minimum(room, _MOST)])
    phi, _ = minimise(residuals, start, low, high, 20, 1e-4)
    return np.asarray(here.natural(phi[:, :size])[0]), phi[0, size:]
