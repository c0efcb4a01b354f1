"""How what forces add to the motion goes with strengths and with the linear parameters.

Under a hand the motor's slow motion is measured: what forces act in hardly changes with what is
fitted.  When they slide and where they hold is history then, and what they add goes with their
strength and with the response of the mechanism.  Everywhere else slopes are simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.trials.forces.bench import ForceBench, Point
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect
from bayeshaptic.inference.fit import search_box
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.types import Complexes, Floats

# Coordinates and logarithms: how far slopes over linear parameters hold.  Fifteen fits of
# friction on PHANToMs end where they do with new ones a round (log likelihoods -13 to 52 higher).
_KEPT = 0.1
_STEP = 1e-3  # of a coordinate, for slopes of a response


@dataclass(frozen=True)
class Along:
    """Slopes of forces' motion over the linear parameters, and where they were taken.

    Where they are simulated they are six tenths of what a round of a fit costs, and what changes
    least in it.

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
    bench: ForceBench,
    forces: tuple[Acting, ...],
    theta: Floats,
    added: Floats,
    distances: Floats,
) -> Complexes:
    """Slopes over the coordinates of the linear parameters, shape (P, I, L): see `Along`.

    Parameters
    ----------
    bench : ForceBench
    forces : tuple of Acting
    theta : ndarray, shape (P,)
    added : ndarray, shape (F, N)
        What each of the forces adds to the motion there.
    distances : ndarray, shape (P,)
        How far each parameter goes where the slopes are simulated.
    """
    here, _, _ = search_box(bench.model)
    phi = here.coordinate(theta[None])[0]
    moving = [not isinstance(one.effect, CommandEffect) for one in forces]
    own = added[moving]
    if not len(own):
        return np.zeros((len(phi), 0, len(bench.frequency_hz)), complex)
    if _is_measured(bench, forces):
        around = here.natural(phi + _STEP * np.concatenate([0 * phi[None], np.eye(len(phi))]))
        response = _response(bench, around, bench.frequency_hz)
        relative = (response[1:] / response[0] - 1) / _STEP
        return np.asarray(relative[:, None] * np.stack([bench.at_lines(one) for one in own]))

    def near(vector: Floats) -> Floats:
        return bench.simulation.added_near(forces, vector, added)[moving]

    found, own = [], near(theta)
    for vector, distance in zip(here.natural(phi + np.diag(distances)), distances, strict=True):
        moves = (near(vector) - own) / distance
        usable = np.isfinite(moves[:, :1])  # not where it runs away
        found.append([bench.at_lines(move) for move in np.where(usable, moves, 0.0)])
    return np.array(found)


def expected(
    bench: ForceBench, near: Point, forces: tuple[Acting, ...], theta: Floats
) -> Floats | None:
    """What forces will add together, from a point near by: where their simulation begins.

    None where the point runs away.

    Parameters
    ----------
    bench : ForceBench
    near : Point
        Those of `forces` with other strengths and shapes.
    forces : tuple of Acting
    theta : ndarray, shape (P,)

    Returns
    -------
    ndarray, shape (N,)
    """
    if not near.changes:
        return None
    samples = bench.recording.samples
    added = np.array([np.broadcast_to(change.motion, samples) for change in near.changes])
    extra = added.sum(axis=0) + grown(added, near.forces, forces)
    if _is_measured(bench, forces):
        frequency_hz: Floats = np.fft.rfftfreq(samples, bench.recording.period_s).astype(float)
        frequency_hz[0] = frequency_hz[1]  # where a hand only damps there is no response at rest
        response = _response(bench, np.stack([near.theta, theta]), frequency_hz)
        extra = np.fft.irfft(np.fft.rfft(extra) * response[1] / response[0], samples)
    return extra


def grown(added: Floats, before: Sequence[Acting], now: Sequence[Acting]) -> Floats:
    """What forces add to their motion by their strengths, with their history as it was, (N,).

    Parameters
    ----------
    added : ndarray, shape (F, N)
    before, now : sequence of Acting
    """
    more = [new.strength / old.strength - 1 for new, old in zip(now, before, strict=True)]
    return np.asarray(np.array(more) @ added)


def _is_measured(bench: ForceBench, forces: Sequence[Acting]) -> bool:
    """Whether the motion that all of the forces act in is measured, as the motor's in a hand is."""
    return bench.held and all(one.effect.place == MOTOR for one in forces)


def _response(bench: ForceBench, theta: Floats, frequency_hz: Floats) -> Complexes:
    """Position of the motor over a force on it, shape (B, L): without delay and filters."""
    system = LinearSystem(bench.model.system(theta).mechanism, np.zeros(len(theta)))
    return system.continuous_response(np.asarray(2j * np.pi * frequency_hz, dtype=complex))
