"""From a place where forces and motion agree to the place where the lines are explained best.

In `bayeshaptic.diagnosis.periodic.harmonic_balance` motion, forces and fit follow one another, so
that each fit takes the forces as given.  But other parameters make another motion, and another
motion other forces.  Where a force is strong, fits that ignore this may lead away from the truth,
and end where the lines are not likeliest.  Here the slopes are those of the balance itself, with
the change of the motion solved for to first order.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.periodic.answering import STEP, Chain, Settled, total
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, balance, turn
from bayeshaptic.diagnosis.periodic.joint import Basis, Joint, unit_forces
from bayeshaptic.diagnosis.periodic.period import Period
from bayeshaptic.diagnosis.periodic.steady_motion import (
    Applied,
    Following,
    Responses,
    Steady,
    no_force,
    places_of,
    steady_motion,
)
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.inference.coordinates import reach
from bayeshaptic.models import Model
from bayeshaptic.numerics.gauss_newton import lengths
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

_TURNS = 30  # after which a motion that has not settled never does
_SETTLED = 1e-3  # of the forces: what their motion still asks for
_STEPS = 12
_ENOUGH = 0.5  # of log likelihood, the noise as large as what is left: a step that is worth nothing
_HOPELESS = 1e3  # damping at which no step helps any more
_FAR = 3.0  # coordinates that a step goes at most: parameters that run to a bound have a long way


def settled(
    joint: Joint, applied: Applied, theta: Floats, strength: Floats, exact: float = _SETTLED
) -> Settled | None:
    """Let forces and motion follow each other until they agree; None where they do not.

    Parameters
    ----------
    joint : Joint
        Whose unit forces are not used.
    applied : Applied
        Forces to begin with.
    theta, strength : ndarray, shapes (P,) and (J,)
    exact : float
        Share of the forces that the motion may still ask for beyond them.
    """
    period, forces = joint.period, joint.forces
    steady, following = Steady(joint.model.system(theta), period, applied.places), Following()
    for _ in range(_TURNS):
        _, applied = turn(steady, forces, strength, applied, following)
        if following.is_within(exact):
            break
    else:
        return None
    motions = steady(applied)
    here = joint.with_unit(unit_forces(forces, motions, period))
    left = here.residual(theta, strength)[here.own]
    return Settled(theta, strength, motions, applied, here, _real(left))


def likeliest(
    model: Model,
    windows: Windows,
    period: Period,
    forces: tuple[Basis, ...],
    theta: Floats,
    strength: Floats,
    fitted: NDArray[np.bool_] | None = None,
) -> Balanced:
    """The model and internal forces for which the lines are likeliest; see `balance`.

    The search begins at the given strengths where all are known.  Where a force is new, or motion
    and forces do not settle there, it begins where a balance ends; where they do not settle there
    either, that end is the result.

    Parameters
    ----------
    model : Model
    windows : Windows
    period : Period
    forces : tuple of Basis
    theta : ndarray, shape (P,)
    strength : ndarray, shape (J,)
    fitted : ndarray of bool, shape (L,), optional
        Lines to fit; all by default.
    """
    own = slice(None) if fitted is None else np.flatnonzero(fitted)
    nothing = no_force(period, tuple(dict.fromkeys(basis.place for basis in forces)))
    joint = Joint(model, windows, period, forces, nothing.rest[:1], own)
    start = None
    if forces and np.all(strength):
        start = _attempt(joint, nothing, theta, strength)
    if start is None:
        part = balance(model, windows, period, forces, theta, strength, fitted)
        if forces:  # rounds that went round are often near it
            start = _attempt(joint, nothing, part.theta, part.strength)
        if start is None:
            return part
    found, slope, unit = _descended(start)
    covariance, along = _strengths(slope, unit, len(unit))
    return Balanced(
        model,
        found.theta,
        forces,
        found.strength,
        np.sqrt(covariance.diagonal()),
        found.joint.columns(found.theta),
        _everywhere(found),
        found.joint.residual(found.theta, found.strength),
        covariance=covariance,
        along=along,
    )


def _everywhere(found: Settled) -> dict[Place, Motion]:
    """The motion at all places."""
    system = found.joint.model.system(found.theta)
    return steady_motion(system, found.joint.period, total(found, places_of(system)))


def _strengths(slope: Floats, unit: Floats, count: int) -> tuple[Floats, Floats]:
    """Covariance of the strengths at unit noise, (J, J), and how coordinates follow, (P, J)."""
    own, strengths = slope[:, :-count], slope[:, -count:]
    along = -np.linalg.pinv(own, rcond=1e-6) @ strengths
    left = strengths + own @ along
    return np.asarray(np.linalg.pinv(left.T @ left) * np.outer(unit, unit)), along / unit


def _descended(start: Settled) -> tuple[Settled, Floats, Floats]:
    """The best place by Levenberg's steps, the last slope (2 F, P + J), and strengths' units."""
    best, damping = start, 1e-3
    here = best.joint.here
    low, high = (here.coordinate(bound) for bound in reach(best.joint.model, 6.0))
    size = len(best.theta)
    for _ in range(_STEPS):
        slope, unit = slope_of(best)
        phi = np.concatenate([here.coordinate(best.theta), best.strength / unit])
        gained = 0.0
        while damping < _HOPELESS:
            there = phi - _step(slope, best.residual, damping)
            there[:size] = np.clip(there[:size], low, high)
            found = None
            if np.all(there[size:] * phi[size:] >= 0):  # a strength stays on its side of zero
                theta = here.natural(there[None, :size])[0]
                found = _attempt(best.joint, best.applied, theta, there[size:] * unit)
            if found is not None and found.power < best.power:
                gained = 0.5 * len(best.residual) * float(np.log(best.power / found.power))
                best, damping = found, max(0.1 * damping, 1e-6)
                break
            damping *= 10
        if gained < _ENOUGH:
            break
    return best, slope, unit


def _attempt(joint: Joint, applied: Applied, theta: Floats, strength: Floats) -> Settled | None:
    try:
        return settled(joint, applied, theta, strength)
    except np.linalg.LinAlgError:  # the motion runs away there
        return None


def _step(slope: Floats, residual: Floats, damping: float) -> Floats:
    """Damped, of at most `_FAR` in each coordinate."""
    scale = lengths(slope)
    rows = np.concatenate([slope / scale, np.sqrt(damping) * np.eye(len(scale))])
    target = np.concatenate([residual, np.zeros(len(scale))])
    step = np.linalg.lstsq(rows, target, rcond=None)[0] / scale
    return np.asarray(np.clip(step, -_FAR, _FAR))


def slope_of(at: Settled) -> tuple[Floats, Floats]:
    """Of the residual over coordinates and strengths, (2 F, P + J), and strengths' units, (J,)."""
    joint, period = at.joint, at.joint.period
    columns = joint.columns(at.theta)
    unit = joint.unit_strengths(columns)
    system = joint.model.system(at.theta)
    chain = Chain(at, Responses(system, period))
    phi = joint.here.coordinate(at.theta)
    base, motion = joint.residual(at.theta, at.strength), chain.held(system)
    found = []
    for index in range(len(phi)):
        moved = phi.copy()
        moved[index] += STEP
        theta = joint.here.natural(moved[None])[0]
        own = (joint.residual(theta, at.strength) - base) / STEP
        change = (chain.held(joint.model.system(theta)) - motion) / STEP
        found.append(own + chain.answer(change))
    for index, basis in enumerate(joint.forces):
        change = chain.moved_by(basis.place, joint.unit[index]) * unit[index]
        found.append(-unit[index] * columns[index] / joint.sd + chain.answer(change))
    return np.stack([_real(row[joint.own]) for row in found], axis=1), unit


def _real(left: Complexes) -> Floats:
    return np.asarray(np.sqrt(2) * np.concatenate([left.real, left.imag]))
