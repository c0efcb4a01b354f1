"""Linear parameters and internal forces fitted together to a periodic recording."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.periodic.joint import Basis, Joint, unit_forces
from bayeshaptic.diagnosis.periodic.period import Period
from bayeshaptic.diagnosis.periodic.steady_motion import (
    Applied,
    Following,
    Steady,
    apply,
    no_force,
    places_of,
)
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.models import Model
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.extrapolation import Approach
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class Balanced:
    """A model and internal forces that agree with the motion they make.

    Attributes
    ----------
    model : Model
    theta : ndarray, shape (P,)
    forces : tuple of Basis
    strength, strength_sd : ndarray, shape (J,)
    columns : complex ndarray, shape (J, L)
        What unit forces add to the position at the lines, in the scale of the spectra.
    motions : dict
        Place to `Motion`.
    residual : complex ndarray, shape (L,)
        Normalised, of all lines.
    converged : bool
    covariance : ndarray, shape (J, J), or None
        Of the strengths at unit noise, where it is the likeliest place.
    along : ndarray, shape (P, J), or None
        How far the coordinates of the parameters go with the strengths.
    """

    model: Model
    theta: Floats
    forces: tuple[Basis, ...]
    strength: Floats
    strength_sd: Floats
    columns: Complexes = field(repr=False)
    motions: dict[Place, Motion] = field(repr=False)
    residual: Complexes = field(repr=False)
    converged: bool = True
    covariance: Floats | None = field(default=None, repr=False)
    along: Floats | None = field(default=None, repr=False)

    @property
    def added(self) -> Complexes:
        """What the internal forces add to the position, in the scale of the spectra, shape (L,)."""
        return np.asarray(self.strength @ self.columns)

    @property
    def is_possible(self) -> bool:
        """Whether motion and forces agree, and no force drives the motion."""
        signs = zip(self.forces, self.strength, strict=True)
        return self.converged and not any(basis.positive and size < 0 for basis, size in signs)

    def rms(self, lines: NDArray[np.bool_] | slice = slice(None)) -> float:
        """Weighted rms over lines; 1 is the noise."""
        return float(np.sqrt(np.mean(np.abs(self.residual[lines]) ** 2)))


def balance(
    model: Model,
    windows: Windows,
    period: Period,
    forces: tuple[Basis, ...],
    theta: Floats,
    strength: Floats | None = None,
    fitted: NDArray[np.bool_] | None = None,
) -> Balanced:
    """Fit a model and internal forces; motion, forces and fit in turn until nothing changes.

    Parameters
    ----------
    model : Model
    windows : Windows
        Of a periodic recording, one line each.
    period : Period
    forces : tuple of Basis
    theta : ndarray, shape (P,)
        Where the linear parameters start.
    strength : ndarray, shape (J,), optional
        Where the strengths start; zero by default.
    fitted : ndarray of bool, shape (L,), optional
        Lines to fit; all by default.

    Returns
    -------
    Balanced
        Its residual is that of all lines, fitted or not.
    """
    own = slice(None) if fitted is None else np.flatnonzero(fitted)
    strength = np.zeros(len(forces)) if strength is None else np.asarray(strength, float)
    applied = no_force(period, places_of(model.system(theta)))
    following, approach = Following(), Approach(len(forces))
    converged = not forces
    rounds = 45
    settled = 0.02  # of a standard deviation of the coefficients, the noise as what is left
    for _ in range(rounds):
        motions, applied = _settle(
            model.system(theta), period, forces, strength, applied, following
        )
        joint = Joint(model, windows, period, forces, unit_forces(forces, motions, period), own)
        new_theta, new_strength = joint.solve(theta, strength)
        sds = joint.sds(new_theta) * max(joint.rms(new_theta, new_strength), 1.0)
        change = np.max(np.abs(new_strength - strength) / sds, initial=0.0)
        theta, strength = new_theta, new_strength
        if not forces or (change < settled and following.arrived):
            converged = True
            break
        theta, strength = joint.ahead(approach, theta, strength)
    # At the fitted parameters: without forces the motions so far are those of the starting ones.
    motions, _ = _settle(model.system(theta), period, forces, strength, applied, following)
    return Balanced(
        model,
        theta,
        forces,
        strength,
        joint.sds(theta),
        joint.columns(theta),
        motions,
        joint.residual(theta, strength),
        converged,
    )


def promise(
    part: Balanced, windows: Windows, period: Period, basis: Basis, fitted: NDArray[np.bool_]
) -> float:
    """Gain in log likelihood that one more force promises, to first order, at the present motion.

    It is the gain beyond what the parameters and the forces that are there would gain without it,
    with noise as large as what is left.  It is cheap, and tells which forces are worth a balance.
    """
    forces = (*part.forces, basis)
    unit, own = unit_forces(forces, part.motions, period), np.flatnonzero(fitted)
    joint = Joint(part.model, windows, period, forces, unit, own)
    left, slope = joint.linearised(part.theta, np.append(part.strength, 0.0))
    along = np.linalg.qr(slope)[0].T @ left  # the new force is the last column
    without = float(left @ left - along[:-1] @ along[:-1])
    share = min(float(along[-1] ** 2) / without, 0.999)
    return -len(own) * float(np.log1p(-share))


def _settle(
    system: LinearSystem,
    period: Period,
    forces: tuple[Basis, ...],
    strength: Floats,
    applied: Applied,
    following: Following,
) -> tuple[dict[Place, Motion], Applied]:
    """Motion from forces and forces from motion, in turn, for given parameters and strengths."""
    turns, steady = 3, Steady(system, period, applied.places)
    for _ in range(turns if forces else 1):
        motions, applied = turn(steady, forces, strength, applied, following)
    return motions, applied


def turn(
    steady: Steady,
    forces: tuple[Basis, ...],
    strength: Floats,
    applied: Applied,
    following: Following,
) -> tuple[dict[Place, Motion], Applied]:
    """The motion under forces, and the forces that this motion asks for."""
    period, motions = steady.period, steady(applied)
    total = {place: np.zeros(period.samples) for place in applied.places}
    for basis, size in zip(forces, strength, strict=True):
        total[basis.place] += size * basis.mean(motions[basis.place], period)
    return motions, apply(period, following.toward(total), motions)
