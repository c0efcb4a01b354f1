"""Fitting a force's strength and shape together with the linear parameters.

Around the present force its motion is linear in the logarithms of strength and shape: their slopes,
simulated, enter the likelihood as further inputs, and one Gauss-Newton fit moves everything.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.state import FIT, share
from bayeshaptic.diagnosis.trials.force_bench import ForceBench, Point
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.inference.fit import search_box
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.numerics.gauss_newton import jacobian, minimise
from bayeshaptic.types import Floats

_NO_GAIN, _SHARE = 0.5, 2e-4  # of the log likelihood, and of what the force gains in all
_ON, _BACK = 2.0, 0.3  # factors on a step that goes well, and on one that does not
_NUDGE = 0.1  # relative, of strength and shape for the slopes
_SDS, _LEAST, _FARTHEST = 5.0, 3e-3, 0.1  # the same of a linear parameter
# Least share of these distances, where slopes over them lead nowhere, and where a sticking mass's
# motion goes smoothly.  In four recordings of a free PHANToM with friction of 0.3 to 0.8 of the rms
# force fits end 0, 51, 38 and 15 in log likelihood short of that from the truth with 0.3 for the
# second (limits up to 1.28 times too high); 0, 4, 0 and 9 with 0.03, 0, 0, 0 and 7 with 0.01.
_NEAREST, _CLOSE, _SMOOTH = 0.1, 0.01, 1e-3
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
    first, before, best = form.logs(found), found, found
    nudges, near, furthest = _nudges(bench), 1.0, 1.0
    rounds = 20
    for _ in range(rounds):
        logs = form.logs(best)
        step = _joint_step(bench, form, logs, best.theta, logs - first, nudges, near)
        factor, point = _advanced(bench, form, best, step)
        gained = point.gain_fit - best.gain_fit
        if gained > 0:
            before, best = best, _onward(bench, form, before, point)
        if gained >= max(_NO_GAIN, _SHARE * best.gain_fit):
            # Slopes over no more than what is still to go.
            near = float(np.clip(factor * step.size / _NUDGE, _NEAREST, furthest))
        elif furthest > _CLOSE:  # once more, with slopes close by
            near = furthest = _CLOSE
        else:
            break
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


def _onward(bench: ForceBench, form: _Form, before: Point, best: Point) -> Point:
    """The best on the line from the point of two steps ago through `best`, beyond it.

    Friction and damping make up for each other along a bent ridge, which steps of rough slopes
    cross to and fro (R. Hooke and T. A. Jeeves, Journal of the ACM 8, 1961: pattern moves).
    """
    here, low, high = search_box(bench.model)
    start, end = here.coordinate(np.stack([before.theta, best.theta]))
    logs, moved = form.logs(best), form.logs(best) - form.logs(before)
    factor = 1.0
    while factor * np.abs(moved).max() < _MOST:
        phi = np.clip(end + factor * (end - start), low, high)
        shaped = form.at(logs + factor * moved)
        further = bench.as_it_is(*shaped, here.natural(phi[None])[0])
        if further.gain_fit < best.gain_fit + _NO_GAIN:
            break
        factor, best = _ON * factor, further
    return best


def _nudges(bench: ForceBench) -> Floats:
    """How far each linear parameter goes for the slopes of the motion: some standard deviations.

    Less would see how a sticking mass jumps, not where it goes; more would leave a resonance.
    """
    fit = bench.state.fit
    here, _, _ = search_box(bench.model)
    relative = fit.sd / np.where(here.log, np.maximum(fit.theta, 1e-300), here.scale)
    return np.clip(np.nan_to_num(_SDS * relative, nan=np.inf), _LEAST, _FARTHEST)


def spread(bench: ForceBench, found: Point) -> tuple[Floats, Floats]:
    """How well a fitted force is known, and what goes with it.

    Parameters
    ----------
    bench : ForceBench
    found : Point

    Returns
    -------
    covariance : ndarray, shape (J, J)
        Of the logarithms of strength and shape.
    along : ndarray, shape (P, J)
        Change of the linear parameters' coordinates (`search_box`) with each logarithm, all else
        fitted anew: friction that is a little more leaves a damper that is far less.
    """
    form = _Form.of(found)
    logs, everything = form.logs(found), (0, 1, 2, 3)
    residuals, start = _linearised(
        bench, form, logs, found.theta, 0 * logs, _nudges(bench), _SMOOTH, everything
    )
    slopes, size = jacobian(residuals, start)[0], bench.model.size
    _, low, high = search_box(bench.model)
    free = (start[0, :size] > low) & (start[0, :size] < high)
    linear, forces = slopes[:, :size][:, free], slopes[:, size:]
    along = np.zeros((size, len(logs)))
    along[free] = -np.linalg.lstsq(linear, forces, rcond=None)[0]
    left = forces + linear @ along[free]
    return np.linalg.pinv(left.T @ left, hermitian=True), along


def _joint_step(
    bench: ForceBench,
    form: _Form,
    logs: Floats,
    theta: Floats,
    moved: Floats,
    nudges: Floats,
    near: float,
) -> _Step:
    """To the linear parameters, strength and shape that fit best together."""
    residuals, start = _linearised(bench, form, logs, theta, moved, nudges, near, FIT)
    here, low, high = search_box(bench.model)
    low = np.concatenate([low, np.full(len(logs), -_MOST)])
    high = np.concatenate([high, np.minimum(form.highest - logs, _MOST)])
    phi, _ = minimise(residuals, start, low, high, 20, 1e-4)
    size = bench.model.size
    return _Step(np.asarray(here.natural(phi[:, :size])[0]), phi[0, size:])


def _linearised(
    bench: ForceBench,
    form: _Form,
    logs: Floats,
    theta: Floats,
    moved: Floats,
    nudges: Floats,
    near: float,
    parts: tuple[int, ...],
) -> tuple[Callable[[Floats], Floats], Floats]:
    """Residuals around a force, which goes on along its slopes, and where they begin, (1, P + J).

    From coordinates and changes of the logarithms, which have moved by `moved` so far.  `near` is
    the share of the usual distances to take the slopes over, `parts` which windows there are.
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
    here, _, _ = search_box(bench.model)
    # The motor's motion under a hand is mostly measured: it hardly depends on the parameters.
    linear = form.effect.place != MOTOR or not bench.held
    if linear:
        around = here.natural(here.coordinate(theta[None]) + np.diag(near * nudges))
        slopes += [
            (motion(logs, vector) - extra) / (near * nudge)
            for vector, nudge in zip(around, nudges, strict=True)
        ]
    slopes = [slope if np.isfinite(slope[0]) else np.zeros_like(slope) for slope in slopes]
    etfe = bench.without(*form.at(logs), extra)
    windows = bench.windows(etfe, theta, slopes)
    # The many slopes leave too little of a window to read its noise from.
    noise = Likelihood(bench.model, bench.windows(etfe, theta)).noise_variance
    chosen = share(windows, parts)
    windows, weight = windows.part(chosen), np.sqrt(2 / noise[chosen])[:, None]
    nodes, size = windows.frequency_hz.shape[1], bench.model.size
    columns = windows.design[:, :, nodes:]
    own = Likelihood(bench.model, replace(windows, design=windows.design[:, :, :nodes]))
    start = np.concatenate([here.coordinate(theta[None])[0], np.zeros(len(logs))])[None]
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

    return residuals, start
