"""How what forces add to the motion goes with the linear parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.types import Complexes, Floats

# Coordinates and logarithms: how far slopes over linear parameters hold.  Fifteen fits of
# friction on PHANToMs end where they do with new ones a round (log likelihoods -13 to 52 higher).
_KEPT = 0.1


@dataclass(frozen=True)
class Along:
    """Slopes of forces' motion over the linear parameters, and where they were taken.

    They are simulated: six tenths of what a round of a fit costs, and what changes least in it.

    Attributes
    ----------
    slopes : complex ndarray, shape (P, I, L)
        Of the motion of each force that moves a mass, at the lines of the spectra.
    strengths : ndarray of int, shape (I,)
        Which of the logarithms is that of its strength.
    at : ndarray
        Coordinates of the parameters, and logarithms of the strengths.
    near : float
        Share of the usual distances that they were taken over.
    """

    slopes: Complexes
    strengths: NDArray[np.intp]
    at: Floats
    near: float

    def holds(self, at: Floats, near: float) -> bool:
        """Whether they are those at another place, too, for distances as small as that."""
        return bool(np.abs(at - self.at).max() <= _KEPT and 2 * near >= self.near)


def slopes_along(
    tryout: Tryout,
    forces: tuple[Acting, ...],
    theta: Floats,
    added: Floats,
    distances: Floats,
) -> Complexes:
    """Slopes over the coordinates of the linear parameters, shape (P, I, L): see `Along`.

    Parameters
    ----------
    tryout : Tryout
    forces : tuple of Acting
    theta : ndarray, shape (P,)
    added : ndarray, shape (F, N)
        What each of the forces adds to the motion there.
    distances : ndarray, shape (P,)
        How far each parameter goes.
    """
    here = coordinates(tryout.model)
    phi = here.coordinate(theta[None])[0]
    moving = [one.moves_a_mass for one in forces]
    if not any(moving):
        return np.zeros((len(phi), 0, len(tryout.at_lines.frequency_hz)), complex)

    def near(vector: Floats) -> Floats:
        return tryout.simulation.added_near(forces, vector, added)[moving]

    found, own = [], near(theta)
    for vector, distance in zip(here.natural(phi + np.diag(distances)), distances, strict=True):
        moves = (near(vector) - own) / distance
        usable = np.isfinite(moves[:, :1])  # not where it runs away
        found.append([tryout.at_lines(move) for move in np.where(usable, moves, 0.0)])
    return np.array(found)
