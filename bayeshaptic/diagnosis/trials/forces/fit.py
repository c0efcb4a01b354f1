"""Fitting strengths and shapes of forces together with the linear parameters.

Slopes of their motion enter the likelihood as further inputs (`slopes.py`), and one
Gauss-Newton fit moves everything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.state import FIT, fit_part
from bayeshaptic.diagnosis.trials.forces.along import Along
from bayeshaptic.diagnosis.trials.forces.form import Form
from bayeshaptic.diagnosis.trials.forces.slopes import NUDGE, Reach, linearised, nudges_of
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.fit import search_box
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.types import Floats

_NO_GAIN, _SHARE = 0.5, 2e-4  # of the log likelihood, and of what the force gains in all
_ON, _BACK = 2.0, 0.3  # factors on a step that goes well, and on one that does not
# Least share of the usual distances for slopes, and where slopes over them lead nowhere.  In four
# recordings of a free PHANToM with friction of 0.3 to 0.8 of the rms force fits end 0, 51, 38 and
# 15 in log likelihood short of that from the truth with 0.3 for the second (limits up to 1.28 times
# too high); 0, 4, 0 and 9 with 0.03, 0, 0, 0 and 7 with 0.01.
_NEAREST, _CLOSE = 0.1, 0.01
_MOST = 0.8  # log change a step; one that wins is doubled


@dataclass(frozen=True)
class _Step:
    """Where to go: the linear parameters there, and the change of the logarithms."""

    theta: Floats
    logs: Floats

    @property
    def size(self) -> float:
        return float(np.abs(self.logs).max())


def fit_force(tryout: Tryout, found: Point) -> Point:
    """The best forces of the laws near `found`, or `found` where nothing is better.

    Where friction holds a motor in a hand, also by way of those that leave the hand the smoothest
    motion: the likelier of both.

    Parameters
    ----------
    tryout : Tryout
    found : Point
        The best of a coarse scan.

    Returns
    -------
    Point
    """
    best = _fit(tryout, found)
    sticks = any(one.effect.sticks and one.effect.place == MOTOR for one in best.forces)
    if not (sticks and best.gain_fit > 0 and tryout.resting):
        return best
    again = _fit(tryout, _fit(tryout.resting, best))
    return max(best, again, key=lambda point: point.gain_fit)


def _fit(tryout: Tryout, found: Point) -> Point:
    """The best by Gauss and Newton's steps from `found`."""
    form, found = Form.of(found), _near(tryout, found, found.forces, found.theta)
    before, best, numbers = found, found, len(form.begun)
    reach, furthest = Reach(nudges_of(tryout), np.ones(numbers)), 1.0
    rounds = 20 if numbers == 1 else 60  # ridges of several numbers are long
    along: Along | None = None
    for _ in range(rounds):
        step, along = _joint_step(tryout, form, best, reach, along)
        if not np.isfinite([*step.theta, *step.logs]).all():  # slopes of a motion that runs away
            break
        factor, point = _advanced(tryout, form, best, step)
        gained = point.gain_fit - best.gain_fit
        if gained > 0:
            before, best = best, _onward(tryout, form, before, point)
        if gained >= max(_NO_GAIN, _SHARE * best.gain_fit):
            # Slopes over no more than what is still to go, each by itself.
            near = np.clip(factor * np.abs(step.logs) / NUDGE, _NEAREST, furthest)
            reach = replace(reach, near=near)
        elif furthest > _CLOSE and best.gain_fit > 0:
            # Once more, with slopes close by; not of what is worth nothing here: that is refused.
            furthest = _CLOSE
            reach = replace(reach, near=np.full(numbers, _CLOSE))
        else:
            break
    return best


def _advanced(tryout: Tryout, form: Form, best: Point, step: _Step) -> tuple[float, Point]:
    """The best point found along `step` from `best`, and how many steps away it is."""
    here, low, high = search_box(tryout.model)
    start, end = here.coordinate(np.stack([best.theta, step.theta]))
    logs = form.logs(best)

    def along(factor: float) -> Point:
        phi = np.clip(start + factor * (end - start), low, high)
        return _near(tryout, best, form.at(logs + factor * step.logs), here.natural(phi[None])[0])

    factor, point = 1.0, along(1.0)
    if point.gain_fit < best.gain_fit:
        for factor in (_BACK, _BACK**2):
            forces = form.at(logs + factor * step.logs)
            polished = _polished(tryout, _near(tryout, best, forces, best.theta))
            point = max(along(factor), polished, key=lambda point: point.gain_fit)
            if point.gain_fit > best.gain_fit:
                break
        return factor, point
    # Slopes of a motion that sticks are rough, and steps along a ridge too short; so are those to
    # where a part of a law vanishes.
    while factor * step.size <= _MOST:
        further = along(_ON * factor)
        if not further.gain_fit - point.gain_fit >= _NO_GAIN:  # nor where both run away
            break
        factor, point = _ON * factor, further
    polished = _polished(tryout, point)
    return factor, max(point, polished, key=lambda point: point.gain_fit)


def _polished(tryout: Tryout, point: Point) -> Point:
    """With the linear parameters fitted anew, and the motion that they make.

    Beside the motion before that fit a point may seem worth more than it is: steps then lead to and
    fro across a ridge, from a damper at zero away from it and back.
    """
    if not np.isfinite(point.gain_fit):
        return point
    theta = fit_part(tryout.model, point.windows, point.theta)
    return _near(tryout, point, point.forces, theta)


def _near(tryout: Tryout, known: Point, forces: tuple[Acting, ...], theta: Floats) -> Point:
    """Forces and linear parameters as they are, beside the motion expected from a point near by.

    By their strengths, with their history as it was.
    """
    if not known.changes:  # it runs away
        return tryout.as_it_is(forces, theta)
    factors = [new.strength / old.strength for new, old in zip(forces, known.forces, strict=True)]
    motions = (change.motion for change in known.changes)
    expected = sum(factor * motion for factor, motion in zip(factors, motions, strict=True))
    return tryout.as_it_is(forces, theta, np.asarray(expected))


def _onward(tryout: Tryout, form: Form, before: Point, best: Point) -> Point:
    """The best on the line from the point of two steps ago through `best`, beyond it.

    Friction and damping make up for each other along a bent ridge, which steps of rough slopes
    cross to and fro (R. Hooke and T. A. Jeeves, Journal of the ACM 8, 1961: pattern moves).
    """
    here, low, high = search_box(tryout.model)
    start, end = here.coordinate(np.stack([before.theta, best.theta]))
    logs, moved = form.logs(best), form.logs(best) - form.logs(before)
    factor = 1.0
    while factor * np.abs(moved).max() < _MOST:
        phi = np.clip(end + factor * (end - start), low, high)
        forces = form.at(logs + factor * moved)
        further = _near(tryout, best, forces, here.natural(phi[None])[0])
        if further.gain_fit < best.gain_fit + _NO_GAIN:
            break
        factor, best = _ON * factor, further
    return best


def _joint_step(
    tryout: Tryout, form: Form, best: Point, reach: Reach, along: Along | None
) -> tuple[_Step, Along]:
    """To the linear parameters, strength and shape that fit best together."""
    residuals, start, along = linearised(tryout, form, best, reach, FIT, along=along)
    here, low, high = search_box(tryout.model)
    low = np.concatenate([low, np.full(len(form.begun), -_MOST)])
    high = np.concatenate([high, np.minimum(form.highest - form.logs(best), _MOST)])
    phi, _ = minimise(residuals, start, low, high, 20, 1e-4)
    size = tryout.model.size
    return _Step(np.asarray(here.natural(phi[:, :size])[0]), phi[0, size:]), along
