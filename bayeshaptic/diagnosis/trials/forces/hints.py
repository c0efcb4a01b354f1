"""What a further force, or a larger law of a known one, would gain, to first order: its score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.trials.forces.slopes import slopes_of_all
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.nonlinear.protocol import Acting, NonlinearEffect

# Standard deviations, from which on a hint is followed: worth 9/4 on the windows to fit, where 10
# are asked for; and the parts of its strength that are tried, which may be far too much.  Of 40
# clean recordings two have any of eleven laws beyond that (3.3 and 3.5); of 112 with a force of the
# bench the law that acts stands out by 20 at least, and by 0.95 of the largest.
STANDS_OUT = 3.0
PARTS = 1.0, 0.3, 0.1
_FAINT = 0.01  # of the faintest strength, or of the way to a law, for the slope over it


@dataclass(frozen=True)
class Hint:
    """What a further force would be, to first order.

    Attributes
    ----------
    effect : NonlinearEffect
    strength : float
    score : float
        How far it stands out of the noise; not below zero where it can only be positive.
    """

    effect: NonlinearEffect
    strength: float
    score: float


def hints(tryout: Tryout, effects: Sequence[NonlinearEffect]) -> list[Hint]:
    """What each further force would be worth beside those of the tryout's state.

    Everything that is fitted moves along, so that a score is standard normal where there is no such
    force (C. R. Rao, Proc. Camb.  Phil. Soc. 44, 1948).  Forces that run away are left out.

    Parameters
    ----------
    tryout : Tryout
    effects : sequence of NonlinearEffect
        Not of actuators.
    """
    theta = tryout.state.fit.theta
    usual = tryout.simulation.motions(theta, tuple({effect.place for effect in effects}))
    tried = []
    for effect in effects:
        faint = _FAINT * float(effect.first_strengths(tryout.model, theta, usual[effect.place])[0])
        tried.append((effect, faint, (*tryout.before, Acting(effect, faint))))
    return _scored(tryout, tryout.as_it_is(tryout.before, theta, tryout.known_motion), tried)


def departures(
    tryout: Tryout, known: Point, effects: Sequence[NonlinearEffect], index: int = -1
) -> list[Hint]:
    """What laws that contain that of a known force would be in its place, to first order.

    A hint's strength is the part of the way from the simple law to the effect's own shape.

    Parameters
    ----------
    tryout : Tryout
    known : Point
        Of the simple law, fitted.
    effects : sequence of NonlinearEffect
        At its place.
    index : int
        Which of the point's forces it is.
    """
    tried = []
    for effect in effects:
        forces = list(known.forces)
        forces[index] = Acting(effect.departing(_FAINT), forces[index].strength)
        tried.append((effect, _FAINT, tuple(forces)))
    return _scored(tryout, known, tried)


def _scored(
    tryout: Tryout,
    found: Point,
    tried: Sequence[tuple[NonlinearEffect, float, tuple[Acting, ...]]],
) -> list[Hint]:
    """Hints around a point: of each effect, a little of it, and the forces with that little."""
    theta, simulation = found.theta, tryout.simulation
    added = simulation.added(found.forces, theta, found.motion)
    own = simulation.added_near(found.forces, theta, added).sum(axis=0)
    if not np.isfinite(own).all():
        return []
    usable, units, moved = [], [], []
    for effect, little, acting in tried:
        near = np.zeros((len(acting), len(own)))
        near[: len(added)] = added
        with_it = simulation.added_near(acting, theta, near).sum(axis=0)
        if np.isfinite(with_it).all():
            usable.append(effect)
            # Of a newton to the cubed metre a unit moves nothing that slopes could see.
            units.append(little / _FAINT)
            # Where no force is known what a hand would do without one is left to the fit: with it
            # other laws stand out where the model lacks something else, and each takes a fit.
            moved.append(((with_it - own) / _FAINT, effect.grounded and bool(found.forces)))
    if not usable:
        return []
    residual, linear, forces, _ = slopes_of_all(tryout, found, moved)
    known, further = np.split(forces, [forces.shape[1] - len(moved)], axis=1)
    base = np.linalg.qr(np.concatenate([linear, known], axis=1))[0]
    further = further - base @ (base.T @ further)
    size = np.maximum(np.linalg.norm(further, axis=0), 1e-300)
    hints, scores = [], -(residual @ further) / size
    for effect, unit, score, one in zip(usable, units, scores, size, strict=True):
        score = score if effect.signed else max(score, 0.0)
        hints.append(Hint(effect, float(unit * score / one), abs(float(score))))
    return hints
