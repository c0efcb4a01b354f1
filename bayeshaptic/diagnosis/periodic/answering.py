"""How forces and the motion answer to a change of either, to first order."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from bayeshaptic.diagnosis.periodic.joint import Joint
from bayeshaptic.diagnosis.periodic.steady_motion import Applied, Responses, pair_of, steady_motion
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.spending import spend
from bayeshaptic.types import Complexes, Floats

STEP = 1e-5
"""Of a coordinate, and of the rms of a motion."""
# Cost of an answer, for each number of the motion, in units of one value of a rational model:
# measured, as is that of a steady motion.
_COST = 50.0
_EXACT, _TERMS = 1e-3, 30  # of the change of a motion, solved for in a Krylov space


@dataclass(frozen=True)
class Settled:
    """Parameters and strengths with the motion and the forces that belong to them.

    Attributes
    ----------
    theta, strength : ndarray, shapes (P,) and (J,)
    motions : mapping
        Of the places with forces.
    applied : Applied
    joint : Joint
        With the unit forces of this motion.
    residual : ndarray, shape (2 F,)
        Of the lines to fit: real and imaginary parts, of unit variance together.
    """

    theta: Floats
    strength: Floats
    motions: Mapping[Place, Motion]
    applied: Applied
    joint: Joint
    residual: Floats

    @property
    def power(self) -> float:
        return float(self.residual @ self.residual)


class Chain:
    """How forces answer to a change of the motion, and the motion to that, at places with forces.

    Motions are positions and velocities, shape (Q, 2, N).
    """

    def __init__(self, at: Settled, responses: Responses) -> None:
        self.period, self.joint = at.joint.period, at.joint
        self.places = at.applied.places
        pairs = [pair_of(place) for place in self.places]
        drive = responses.mechanism.drive
        between = [[responses(a, b) for b in pairs] for a in pairs]
        # What moves below all excited lines is taken as measured: it does not answer.
        self.between = np.where(self.period.free, 0.0, np.array(between))  # (Q, Q, H)
        self.seen = np.stack([responses(drive, pair) for pair in pairs])
        self.gain = np.stack([self._gain(place, at) for place in self.places])  # (Q, 2, N)
        self.applied = total(at, self.places)

    def _gain(self, place: Place, at: Settled) -> Floats:
        """Slopes of the force at a place over position and velocity there, (2, N)."""
        motion, slopes = at.motions[place], np.zeros((2, self.period.samples))
        own = [
            (b, s) for b, s in zip(at.joint.forces, at.strength, strict=True) if b.place == place
        ]
        for row, name in enumerate(("position", "velocity")):
            step = STEP * float(np.std(getattr(motion, name)))
            for basis, size in own:
                up, down = (
                    basis.mean(_moved(motion, name, sign * step), self.period) for sign in (1, -1)
                )
                slopes[row] += size * (up - down) / (2 * step)
        return slopes

    def held(self, system: LinearSystem) -> Floats:
        """The motion with the forces held, (Q, 2, N)."""
        motions = steady_motion(system, self.period, self.applied)
        return np.stack([[motions[p].position, motions[p].velocity] for p in self.places])

    def moved_by(self, place: Place, lines: Complexes) -> Floats:
        """The motion that a force at a place makes, (Q, 2, N)."""
        return self._motion(self.between[:, self.places.index(place)] * lines)

    def _motion(self, lines: Complexes) -> Floats:
        """From harmonics (Q, H)."""
        return np.stack(
            [[self.period.signal(row), self.period.signal(self.period.s * row)] for row in lines]
        )

    def answer(self, change: Floats) -> Complexes:
        """The residual's change with a change of the motion, the forces held; normalised, (L,)."""
        shape = change.shape[0], change.shape[2]

        def forces(motion: Floats) -> Floats:
            return np.asarray((self.gain * motion).sum(axis=1))

        def rest(flat: Floats) -> Floats:
            lines = self.period.transform(flat.reshape(shape))
            moved = self._motion(np.einsum("abh,bh->ah", self.between, lines))
            return flat - forces(moved).ravel()

        size = shape[0] * shape[1]
        spend(_COST * size)
        first = forces(change).ravel()
        found, _ = gmres(
            LinearOperator((size, size), rest), first, rtol=_EXACT, restart=_TERMS, maxiter=1
        )
        lines = self.period.transform(found.reshape(shape))
        added = np.einsum("ah,ah->h", self.seen, lines)
        return np.asarray(-self.period.at_lines(added) / self.joint.sd)


def _moved(motion: Motion, name: str, by: float) -> Motion:
    position, velocity = motion.position, motion.velocity
    if name == "position":
        return Motion(position + by, velocity, motion.command)
    return Motion(position, velocity + by, motion.command)


def total(at: Settled, places: tuple[Place, ...]) -> Applied:
    """The forces as they are, and none that answers to the motion."""
    total = {place: np.zeros(len(at.joint.period.harmonics), complex) for place in places}
    for basis, size, unit in zip(at.joint.forces, at.strength, at.joint.unit, strict=True):
        total[basis.place] = total[basis.place] + size * unit
    rest = np.array([total[place] for place in places])
    return Applied(places, np.zeros_like(rest), rest)
