"""Linear parameters and strengths of internal forces, fitted together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.periodic.period import Period
from bayeshaptic.diagnosis.periodic.steady_motion import Responses, pair_of
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.inference.coordinates import coordinates, reach
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.numerics.extrapolation import Approach
from bayeshaptic.numerics.gauss_newton import jacobian, minimise
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats


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

    def mean(self, motion: Motion, period: Period) -> Floats:
        """The force over one period, shape (N,): the mean over what else the device does."""
        besides = period.unrepeated
        share = 0.0 if self.place.second is not None else 1.0
        each = Motion(
            motion.position + share * besides.position,
            motion.velocity + share * besides.velocity,
            motion.command,
        )
        return np.asarray(self.force(each).mean(axis=0))


def unit_forces(
    forces: Sequence[Basis], motions: Mapping[Place, Motion], period: Period
) -> Complexes:
    """Harmonics of a unit of each force that follows from the motions, shape (J, H)."""
    return np.array([period.transform(one.mean(motions[one.place], period)) for one in forces])


class Joint:
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
        self.model, self.windows, self.period, self.forces = model, windows, period, forces
        self.unit = unit
        self.own = own
        self.likelihood = Likelihood(model, windows)
        self.sd = np.sqrt(self.likelihood.noise_variance)
        self.here = coordinates(model)

    def with_unit(self, unit: Complexes) -> Joint:
        """With other unit forces."""
        other = copy(self)
        other.unit = unit
        return other

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
            left = (left - (phi[:, size:] * self.unit_strengths(columns)) @ rows)[:, self.own]
            return np.sqrt(2) * np.concatenate([left.real, left.imag], axis=1)

        return residuals

    def unit_strengths(self, columns: Complexes) -> Floats:
        """Strengths that are much: as large as the response itself, shape (J,).

        A step of the minimiser is at most one coordinate unit.
        """
        power = np.mean(np.abs(columns / self.sd) ** 2, axis=1)
        whole = np.mean(np.abs(self.likelihood.windows.target[:, 0] / self.sd) ** 2)
        return np.asarray(0.1 * np.sqrt(whole / (power + 1e-300)))

    def solve(self, theta: Floats, strength: Floats) -> tuple[Floats, Floats]:
        """A few damped Gauss-Newton steps, the columns those of the current parameters."""
        columns = self.columns(theta)
        unit = self.unit_strengths(columns)
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
        phi = np.concatenate(
            [self.here.coordinate(theta), strength / self.unit_strengths(columns)]
        )[None]
        residuals = self._residuals(columns)
        return residuals(phi)[0], jacobian(residuals, phi)[0]

    def sds(self, theta: Floats) -> Floats:
        """Standard deviations of the strengths at unit noise, shape (J,)."""
        if not self.forces:
            return np.zeros(0)
        slope = self.linearised(theta, np.zeros(len(self.forces)))[1]
        # Roots of the diagonal of (slope^T slope)^+, of which rounding makes none negative.
        sd = np.linalg.norm(np.linalg.pinv(slope), axis=1)[self.model.size :]
        return np.asarray(sd * self.unit_strengths(self.columns(theta)))
