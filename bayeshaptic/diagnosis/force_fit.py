"""Fitting a force's strength and shape together with the linear parameters.

Around the present force its motion is linear in the logarithms of strength and shape: their slopes,
simulated, enter the likelihood as further inputs, and one Gauss-Newton fit moves everything.
"""

from __future__ import annotations

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
_ENOUGH = 3e-3  # relative change of strength and shape
_NO_GAIN = 0.5  # of the log likelihood
_NUDGE = 0.05  # relative, for the slopes
_SMALL = 3e-3  # the same of a linear parameter: resonances are sharp
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
    effect, theta = found.effect, found.theta
    names = effect.tuned
    logs = np.log([abs(found.strength), *(effect.shape[name] for name in names)])
    first, sign = logs.copy(), np.sign(found.strength)

    def motion(logs: Floats, theta: Floats) -> Floats:
        shaped = _shaped(effect, names, logs)
        return bench.added_motion(shaped, float(sign * np.exp(logs[0])), theta)

    here, _, _ = search_box(bench.model)
    # The motor's motion under a hand is mostly measured: it hardly depends on the parameters.
    coupled = effect.place != MOTOR or not bench.held
    before = np.inf
    for _ in range(_ROUNDS):
        extra = motion(logs, theta)
        bench.remember(extra)
        slopes = [
            (motion(logs + _NUDGE * unit, theta) - extra) / _NUDGE for unit in np.eye(len(logs))
        ]
        if coupled:
            phi = here.coordinate(theta[None])
            moved = here.natural(phi + _SMALL * np.eye(len(theta)))
            slopes += [(motion(logs, vector) - extra) / _SMALL for vector in moved]
        _, windows = bench.without(extra, theta, slopes)
        # The many slopes leave too little of a window to read its noise from.
        noise = Likelihood(bench.model, bench.without(extra, theta)[1]).noise_variance
        chosen = share(windows, FIT)
        theta, step, cost = _joint_step(
            bench, windows.part(chosen), noise[chosen], theta, logs - first
        )
        logs, gained, before = logs + step, before - cost, cost
        if np.abs(step).max() < _ENOUGH and abs(gained) < _NO_GAIN:
            break
    best = bench.point(_shaped(effect, names, logs), float(sign * np.exp(logs[0])), theta, rounds=2)
    return best if best.gain_fit > found.gain_fit else found


def _shaped(effect: NonlinearEffect, names: tuple[str, ...], logs: Floats) -> NonlinearEffect:
    values = {name: float(np.exp(log)) for name, log in zip(names, logs[1:], strict=True)}
    return replace(effect, shape={**effect.shape, **values})


def _joint_step(
    bench: ForceBench, windows: Windows, noise: Floats, theta: Floats, moved: Floats
) -> tuple[Floats, Floats, float]:
    """Linear parameters, and the change of log strength and shape, that fit best together.

    Also half the sum of squares that they leave.
    """
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
    high = np.concatenate([high, np.full(inputs, _MOST)])
    phi, cost = minimise(residuals, start, low, high, 20, 1e-4)
    return np.asarray(here.natural(phi[:, :size])[0]), phi[0, size:], float(cost[0])
