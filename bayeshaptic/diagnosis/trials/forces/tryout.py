"""One recording and one linear model, on which internal forces are tried.

What forces add to the motion is simulated and taken off the recording, and the linear parameters
are fitted to the rest.  Forces that were found before are put back and simulated together with the
one that is tried: each acts in the motion that all of them make, and what was taken for one may be
another's.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.state import Change, State, fit_part, log_likelihoods
from bayeshaptic.diagnosis.trials.forces.answer import Answer
from bayeshaptic.diagnosis.trials.forces.in_pieces import simulation_in
from bayeshaptic.diagnosis.trials.taken_off import with_forces
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, NonlinearEffect
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Complexes, Floats

_Simulated = tuple[tuple[Change, ...], Etfe, Windows]


@dataclass(frozen=True)
class Point:
    """What forces give.

    Attributes
    ----------
    forces : tuple of Acting
        Those that were found before, and the one that is tried.
    theta : ndarray, shape (P,)
        Linear parameters fitted beside them.
    changes : tuple of Change
        What each of them takes off the recording.
    etfe : Etfe
        Less that.
    windows : Windows
    gain_fit, gain_choose : float
        Gain in log likelihood on the windows to fit and on those to choose by.
    """

    forces: tuple[Acting, ...]
    theta: Floats
    changes: tuple[Change, ...]
    etfe: Etfe
    windows: Windows
    gain_fit: float
    gain_choose: float

    @property
    def effect(self) -> NonlinearEffect:
        """The one that is tried."""
        return self.forces[-1].effect

    @property
    def strength(self) -> float:
        """Of the one that is tried."""
        return self.forces[-1].strength

    @property
    def motion(self) -> Floats | None:
        """What all of them add to the motor's position, shape (N,); None where it runs away."""
        return _motion(self.changes) if self.changes else None


class Tryout:
    """Takes off what forces do, and fits what they leave.

    Parameters
    ----------
    state : State
    recording : Recording

    Attributes
    ----------
    before : tuple of Acting
        The forces of the state, which act beside what is tried.
    at_lines : Lines
        Of the spectra.
    simulation : Simulation
        Of forces in the recording, those of the state put back.
    """

    def __init__(self, state: State, recording: Recording) -> None:
        self.state = state
        self.model = state.model
        self.held = self.model.held
        there = [e.change for e in state.accepted if e.change and e.change.acting]
        self.before = tuple(change.acting for change in there if change.acting)
        self._etfe = with_forces(replace(state.etfe, recording=recording), there)
        assert self._etfe.recording is not None
        self.recording = self._etfe.recording
        self.at_lines = Lines.of(state.etfe, recording)
        self._somewhere = state.fit.windows.frequency_hz.mean(axis=1)
        self._base = self._likelihoods(state.fit.theta, state.fit.windows)
        self.simulation = simulation_in(
            state, self.recording, self._usual(), np.zeros(recording.samples) + _motion(there)
        )

    def _usual(self) -> Floats:
        """The linear parameters that fit where no force is taken off."""
        theta = self.state.fit.theta
        if not self.before:
            return theta
        return polish(self.model, self.windows(self._etfe, theta), theta)

    @property
    def known_motion(self) -> Floats | None:
        """What the forces of the state add to the motion, shape (N,); None where it has none."""
        return self.simulation.there if self.before else None

    def point(
        self,
        forces: tuple[Acting, ...],
        theta: Floats,
        rounds: int = 1,
        expected: Floats | None = None,
    ) -> Point:
        """Simulate, take off, fit; several times over, because the fit changes the motion.

        `expected`, (N,), is what forces may be expected to add: the search begins with it.
        """
        found = None
        for _ in range(rounds):
            found = self._simulated(forces, theta, expected)
            if found is None:
                break
            theta = fit_part(self.model, found[-1], theta)
            expected = _motion(found[0])
        return self._valued(forces, theta, found)

    def as_it_is(
        self, forces: tuple[Acting, ...], theta: Floats, expected: Floats | None = None
    ) -> Point:
        """Simulate and take off, with the linear parameters as given: see `point`."""
        return self._valued(forces, theta, self._simulated(forces, theta, expected))

    @cached_property
    def resting(self) -> Tryout | None:
        """With friction at rest told from how smoothly a hand moves; None where nothing rests."""
        simulation = self.simulation.resting
        if simulation is None:
            return None
        other = copy(self)
        other.simulation = simulation
        return other

    def stays(self, point: Point) -> bool:
        """Whether the mass does not run away with these forces, after the last fit."""
        if point.motion is None:
            return False
        return bool(
            np.isfinite(self.simulation.added(point.forces, point.theta, point.motion)).all()
        )

    def without(self, changes: Sequence[Change], theta: Floats) -> Etfe:
        """The measurement without what forces do beside linear parameters, shape (P,)."""
        added, louder = answered(changes), None
        if self.held and added is not None:
            louder = self.answer(theta).louder(added, self._somewhere)
        return with_forces(self._etfe, changes, -1.0, louder)

    def answer(self, theta: Floats) -> Answer:
        """How the answer of forces to a motion is read beside linear parameters, shape (P,)."""
        system, spectra = self.model.system(theta), self._etfe.spectra
        frequency_hz = self.at_lines.frequency_hz
        return Answer.of(system, frequency_hz, spectra.position, self.simulation.edge_hz)  # type: ignore[attr-defined]

    def changes(self, forces: tuple[Acting, ...], added: Floats) -> tuple[Change, ...]:
        """What each force takes off the recording, of the motions that they add, (F, N)."""
        found, command = [], self.simulation.command
        for one, motion in zip(forces, added, strict=True):
            if isinstance(one.effect, CommandEffect):
                lost = one.effect.lost(one.strength, command)
                command = command - lost
                found.append(Change(None, one, self.at_lines(lost), 0.0, lost, 0.0))
            else:
                found.append(Change(None, one, 0.0, self.at_lines(motion), 0.0, motion))
        return tuple(found)

    def windows(self, etfe: Etfe, theta: Floats, columns: list[Complexes] | None = None) -> Windows:
        """Windows of a measurement, with motions, at its lines, as further inputs."""
        inputs = np.stack(columns) if columns else None
        return compress(etfe, partial(self.model.response, theta, measured=True), inputs)

    def _simulated(
        self, forces: tuple[Acting, ...], theta: Floats, expected: Floats | None
    ) -> _Simulated | None:
        """What forces do, and the measurement without it, with its windows.

        None where the mass runs away, or where no response is a number (a damper at zero behind a
        spring a thousand times too stiff).
        """
        if not np.all(np.isfinite(self.model.response(theta, self._somewhere, measured=True))):
            return None
        added = self.simulation.added(forces, theta, expected)
        if not np.isfinite(added).all():
            return None
        changes = self.changes(forces, added)
        etfe = self.without(changes, theta)
        louder = etfe.spectra.louder  # type: ignore[attr-defined]
        if louder is not None and not np.isfinite(louder).all():
            return None
        return changes, etfe, self.windows(etfe, theta)

    def _valued(self, forces: tuple[Acting, ...], theta: Floats, found: _Simulated | None) -> Point:
        if found is None:  # nothing that runs away explains what was measured
            state = self.state
            return Point(forces, theta, (), state.etfe, state.fit.windows, -np.inf, -np.inf)
        gains = self._likelihoods(theta, found[-1]) - self._base
        return Point(forces, theta, *found, float(gains[0]), float(gains[1]))

    def _likelihoods(self, theta: Floats, windows: Windows) -> Floats:
        return log_likelihoods(self.model, windows, theta)


def answered(changes: Sequence[Change]) -> Complexes | None:
    """What the forces that answer to a hand add to the position at the lines, (L,), or None."""
    own = [c.position for c in changes if c.acting and c.acting.effect.grounded]
    return np.asarray(sum(own)) if own else None


def _motion(changes: Sequence[Change]) -> Floats:
    """What all of them add to the motor's position; 0 where none moves a mass."""
    return np.asarray(sum(change.motion for change in changes))
