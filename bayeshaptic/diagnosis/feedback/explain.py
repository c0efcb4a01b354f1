"""Closing the loop on the force instead of the response, where feedback biases the response."""

from __future__ import annotations

from dataclasses import dataclass

from bayeshaptic.diagnosis.acceptance import verdict_of
from bayeshaptic.diagnosis.feedback.inverse_dynamics import InverseDynamics, inverse_dynamics
from bayeshaptic.diagnosis.state import Accepted, Estimate, State
from bayeshaptic.diagnosis.traced import UNEXPLAINED, Traced
from bayeshaptic.effects.library import effects
from bayeshaptic.errors import InputError
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.join import unbroken
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe

_FRICTION = "coulomb"


@dataclass(frozen=True)
class ForceExplained:
    """The force of a recording with feedback, explained by its motion.

    Attributes
    ----------
    first : InverseDynamics
        Mass, damping and offset, and the one term that mattered most.
    further : InverseDynamics
        With every term that earned its place.
    """

    first: InverseDynamics
    further: InverseDynamics


def explain_force(recording: Recording | None) -> ForceExplained | None:
    """Inverse dynamics of a recording.

    None where it is too short for it, or where the motion leaves so much of the force that the
    device cannot move as one mass.
    """
    if recording is None:
        return None
    recording = unbroken(recording)
    try:
        further = inverse_dynamics(recording)
    except InputError:
        return None
    one_mass = 0.3  # of the force that may be left where the device moves as one mass
    if further.relative_error > one_mass:
        return None
    terms = tuple(step.term for step in further.steps[1:2])
    return ForceExplained(inverse_dynamics(recording, terms=terms) if terms else further, further)


def trace_force(etfe: Etfe, fit: Fit, force: ForceExplained) -> Traced:
    """What the loop found in the force; the residual of the biased response is not looked at."""
    state = State(etfe, fit, _friction(force))
    return Traced(*verdict_of(state.accepted, ()), state, (), ())


def left_alone(etfe: Etfe, fit: Fit, force: ForceExplained | None) -> Traced:
    """The record of a biased response whose motion cannot be followed: nothing is traced in it."""
    state = State(etfe, fit, () if force is None else _friction(force))
    return Traced(UNEXPLAINED, None, state, (), ())


def _friction(force: ForceExplained) -> tuple[Accepted, ...]:
    """Dry friction, where it is the term that mattered most."""
    linear, *added = force.further.steps
    if not added or added[0].term != _FRICTION:
        return ()
    (kind,) = (e for e in effects("nonlinear") if e.name == "coulomb_friction")
    (term,) = (t for t in force.first.terms if t.name == _FRICTION)
    evidence = (
        f"lowers the error of the force on the half that was not fitted from "
        f"{linear.held_out_rms:.3g} to {added[0].held_out_rms:.3g} {term.unit} rms (inverse "
        "dynamics, which feedback does not bias)"
    )
    estimates = {"friction_force": Estimate(*force.first[_FRICTION], term.unit)}
    return (Accepted(kind.name, kind.title, kind.family, evidence, estimates),)
