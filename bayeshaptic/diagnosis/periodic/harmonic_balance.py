"""Linear parameters and internal forces fitted together to a periodic recording."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.periodic.steady_motion import (
    Applied,
    Complexes,
    Floats,
    Following,
    Period,
    Responses,
    apply,
    no_force,
    pair_of,
    places_of,
    steady_motion,
)
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.inference.coordinates import coordinates, reach
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.extrapolation import Approach
from bayeshaptic.numerics.gauss_newton import jacobian, minimise
from bayeshaptic.recordings.response.windows import Windows


@dataclass(frozen=True)
class Basis:
    """An internal force of unit strength at a place.

    Attributes
    ----------
    name, title : str
    place : Place
    force : callable
        From `Motion` (one period) to the force, shape (N,).
    unit : str
        Of its strength.
    positive : bool
        Whether a negative strength makes no sense.
    """

    name: str
    title: str
    place: Place
    force: Callable[[Motion], Floats]
    unit: str = ""
    positive: bool = False


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

    @property
    def added(self) -> Complexes:
        """What the internal forces add to the position, in the scale of the spectra, shape (L,)."""
        return np.asarray(self.strength @ self.columns)

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
        unit = [period.transform(basis.force(motions[basis.place])) for basis in forces]
        joint = _Joint(model, windows, period, forces, np.array(unit), own)
        new_theta, new_strength = joint.solve(theta, strength)
        sds = joint.sds(new_theta) * max(joint.rms(new_theta, new_strength), 1.0)
        change = np.max(np.abs(new_strength - strength) / sds, initial=0.0)
        theta, strength = new_theta, new_strength
        if not forces or (change < settled and following.arrived):
            converged = True
            break
        theta, strength = joint.ahead(approach, theta, strength)
    # Of the parameters found: without forces those of the start were the only ones so far.
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
    """Gain in log likelihood that one more force promises, to first order, the motion as it is.

    Beyond what parameters and forces that are there would gain without it; the noise is as large as
    what is left.  Cheap: it tells which forces are worth a balance.
    """
    forces = (*part.forces, basis)
    unit = [period.transform(b.force(part.motions[b.place])) for b in forces]
    own = np.flatnonzero(fitted)
    joint = _Joint(part.model, windows, period, forces, np.array(unit), own)
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
    turns = 3
    for _ in range(turns if forces else 1):
        motions = steady_motion(system, period, applied)
        total = {place: np.zeros(period.samples) for place in applied.places}
        for basis, size in zip(forces, strength, strict=True):
            total[basis.place] += size * basis.force(motions[basis.place])
        applied = apply(period, following.toward(total), motions)
    return motions, applied


class _Joint:
    """Least squares of parameters and strengths with the forces' shapes held."""

    def __init__(
        self,
        model: Model,
        windows: Windows,
        period: Period,
        forces: tuple[Basis, ...],
        unit: Complexes,
        own: slice | NDArray[np.intp],
    ) -> None:
        self.model, self.period, self.forces, self.unit = model, period, forces, unit
        self.own = own
        self.likelihood = Likelihood(model, windows)
        self.sd = np.sqrt(self.likelihood.noise_variance)
        self.here = coordinates(model)

    def columns(self, theta: Floats) -> Complexes:
        """What unit forces add to the measured position at the lines, shape (J, L)."""
        responses = Responses(self.model.system(theta), self.period)
        drive = responses.mechanism.drive
        rows = [
            responses(drive, pair_of(basis.place)) * row
            for basis, row in zip(self.forces, self.unit, strict=True)
        ]
        shape = (0, len(self.sd))
        return self.period.at_lines(np.stack(rows)) if rows else np.zeros(shape, complex)

    def residual(self, theta: Floats, strength: Floats) -> Complexes:
        left = self.likelihood.deviations(theta[None])[0, :, 0]
        return np.asarray((left - strength @ self.columns(theta)) / self.sd)

    def rms(self, theta: Floats, strength: Floats) -> float:
        """Weighted rms of the lines to fit."""
        return float(np.sqrt(np.mean(np.abs(self.residual(theta, strength)[self.own]) ** 2)))

    def _residuals(self, columns: Complexes) -> Callable[[Floats], Floats]:
        size = self.model.size
        rows = columns / self.sd

        def residuals(phi: Floats) -> Floats:
            theta = self.here.natural(phi[:, :size])
            left = self.likelihood.deviations(theta)[:, :, 0] / self.sd
            left = (left - (phi[:, size:] * self._unit(columns)) @ rows)[:, self.own]
            return np.sqrt(2) * np.concatenate([left.real, left.imag], axis=1)

        return residuals

    def _unit(self, columns: Complexes) -> Floats:
        """Strengths that are much: as large as the response itself, shape (J,).

        A step of the minimiser is at most one coordinate unit.
        """
        power = np.mean(np.abs(columns / self.sd) ** 2, axis=1)
        whole = np.mean(np.abs(self.likelihood.windows.target[:, 0] / self.sd) ** 2)
        return np.asarray(0.1 * np.sqrt(whole / (power + 1e-300)))

    def solve(self, theta: Floats, strength: Floats) -> tuple[Floats, Floats]:
        """A few damped Gauss-Newton steps, the columns those of the current parameters."""
        columns = self.columns(theta)
        unit = self._unit(columns)
        low, high = (self.here.coordinate(bound) for bound in reach(self.model, 6.0))
        wide = np.full(len(strength), np.inf)
        start = np.concatenate([self.here.coordinate(theta), strength / unit])
        phi, _ = minimise(
            self._residuals(columns),
            start[None],
            np.concatenate([low, -wide]),
            np.concatenate([high, wide]),
            steps=30,
            tolerance=1e-4,
        )
        size = self.model.size
        return self.here.natural(phi[:, :size])[0], phi[0, size:] * unit

    def ahead(self, approach: Approach, theta: Floats, strength: Floats) -> tuple[Floats, Floats]:
        """Where parameters and strengths are going; a strength stays on its side of zero."""
        here = np.concatenate([strength, self.here.coordinate(theta)])
        there, phi = np.split(approach.ahead(here), [len(strength)])
        if np.all(there == strength) or np.any(there * strength < 0):
            return theta, strength
        low, high = (self.here.coordinate(bound) for bound in reach(self.model, 6.0))
        return self.here.natural(np.clip(phi, low, high)[None])[0], there

    def linearised(self, theta: Floats, strength: Floats) -> tuple[Floats, Floats]:
        """Residuals of the lines to fit, (N,), and their slope, (N, P + J)."""
        columns = self.columns(theta)
        phi = np.concatenate([self.here.coordinate(theta), strength / self._unit(columns)])[None]
        residuals = self._residuals(columns)
        return residuals(phi)[0], jacobian(residuals, phi)[0]

    def sds(self, theta: Floats) -> Floats:
        """Standard deviations of the strengths at unit noise, shape (J,)."""
        if not self.forces:
            return np.zeros(0)
        slope = self.linearised(theta, np.zeros(len(self.forces)))[1]
        # Roots of the diagonal of (slope^T slope)^+, of which rounding makes none negative.
        sd = np.linalg.norm(np.linalg.pinv(slope), axis=1)[self.model.size :]
        return np.asarray(sd * self._unit(self.columns(theta)))
