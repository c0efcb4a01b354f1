"""Forces in a recording of several pieces: one law for all, each piece simulated by itself.

Where each piece begins, and how fast it moves there, is its own, and nothing is known of the time
between them.  A force is of the device, and so the same in all.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.simulation import Simulation
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Acting, Motion
from bayeshaptic.models import Model
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.types import Floats


def simulated_in(state: State) -> Recording | None:
    """The recording that forces can be simulated in; None where there is none.

    In several pieces only where nobody holds the device: a hand's own motion is read off one.

    Parameters
    ----------
    state : State
    """
    etfe = state.etfe
    if not etfe.parts or etfe.recording is None:
        return etfe.unbroken
    plain = all(type(part.spectra) is RandomSpectra for part in etfe.parts)
    return etfe.recording if plain and not state.model.held else None


def simulation_in(
    state: State, recording: Recording, usual: Floats, there: Floats
) -> Simulation | SimulationInPieces:
    """The simulation of forces in a recording of one piece, or of several.

    Parameters
    ----------
    state : State
    recording : Recording
        With what the forces of the state do in it.
    usual, there : ndarray
        As in `Simulation`.
    """
    if not state.etfe.parts:
        return Simulation(state.model, recording, usual, there)
    spans = state.etfe.spans
    simulations = tuple(
        Simulation(state.model, replace(recording.part(own.start, own.stop)), usual, there[own])
        for own in spans
    )
    return SimulationInPieces(recording, spans, simulations, there)


@dataclass(frozen=True)
class SimulationInPieces:
    """Simulates what forces add to the motion of each piece, as `Simulation` does of one.

    Attributes
    ----------
    recording : Recording
    spans : tuple of slice
        The samples of the pieces that count; in others nothing moves.
    each : tuple of Simulation
        Of these.
    there : ndarray, shape (N,)
        What forces that are known to act add to the motion.
    """

    recording: Recording
    spans: tuple[slice, ...]
    each: tuple[Simulation, ...]
    there: Floats

    @property
    def model(self) -> Model:
        return self.each[0].model

    @property
    def usual(self) -> Floats:
        """The linear parameters that fit where no force is taken off, shape (P,)."""
        return self.each[0].usual

    @property
    def command(self) -> Floats:
        """The commanded force, shape (N,)."""
        return self.recording.force

    @cached_property
    def edge_hz(self) -> float:
        """Up to where a hand's motion would be read, which nobody asks where nobody holds it."""
        return max(one.edge_hz for one in self.each)

    @property
    def resting(self) -> None:
        """Nobody's hand moves it while it rests."""
        return None

    def motions(self, theta: Floats, places: tuple[Place, ...]) -> dict[Place, Motion]:
        """Position and velocity at places, one piece after the other."""
        found = [one.motions(theta, places) for one in self.each]
        return {
            place: Motion(
                *(
                    np.concatenate([getattr(motions[place], name) for motions in found])
                    for name in ("position", "velocity", "command")
                )
            )
            for place in found[0]
        }

    def added(
        self, forces: tuple[Acting, ...], theta: Floats, expected: Floats | None = None
    ) -> Floats:
        """What each force adds to the motor's position, shape (F, N); nan where it runs away."""
        return self._all(
            [
                one.added(forces, theta, None if expected is None else expected[own])
                for one, own in zip(self.each, self.spans, strict=True)
            ]
        )

    def added_near(self, forces: tuple[Acting, ...], theta: Floats, near: Floats) -> Floats:
        """What forces add, to first order in how that differs from `near`, shapes (F, N)."""
        return self._all(
            [
                one.added_near(forces, theta, near[:, own])
                for one, own in zip(self.each, self.spans, strict=True)
            ]
        )

    def driven(self, forces: tuple[Acting, ...], theta: Floats, added: Floats) -> Floats:
        """The sum of motions added, shape (N,), and what an actuator's forces do."""
        return self._all(
            [
                one.driven(forces, theta, added[:, own])
                for one, own in zip(self.each, self.spans, strict=True)
            ]
        )

    def _all(self, found: list[Floats]) -> Floats:
        """Of the pieces that count that of all samples; what runs away in one runs away in all."""
        every = np.zeros((*found[0].shape[:-1], self.recording.samples))
        if not all(np.isfinite(own).all() for own in found):
            return np.full_like(every, np.nan)
        for span, own in zip(self.spans, found, strict=True):
            every[..., span] = own
        return every
