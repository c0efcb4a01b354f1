"""From where a force and its motion agree to where the lines are likeliest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_unrepeated import DRAG, dragged

import bayeshaptic as bh
from bayeshaptic.diagnosis.periodic.answering import Settled
from bayeshaptic.diagnosis.periodic.balanced_state import BalancedState
from bayeshaptic.diagnosis.periodic.descent import settled, slope_of
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.joint import Basis, Joint
from bayeshaptic.diagnosis.periodic.lines import LineTrials
from bayeshaptic.diagnosis.periodic.steady_motion import no_force
from bayeshaptic.diagnosis.state import Accepted
from bayeshaptic.diagnosis.trials.linear import accepted_with
from bayeshaptic.effects.linear.attached_mass import SecondMode
from bayeshaptic.numerics.spending import Meter


@pytest.fixture(scope="module")
def kind() -> LineTrials:
    etfe = bh.estimate_etfe(dragged(0.0))
    return LineTrials(etfe, bh.least_squares(bh.rigid(delay_s=0.0), etfe), floor=0.0)


def law(kind: LineTrials, power: int) -> Basis:
    part = kind.first.part
    every = force_candidates(part.model, part.motions)
    laws = [basis for variants in every.values() for basis in variants]
    return next(basis for basis in laws if f"power {power}" in basis.title)


def at(kind: LineTrials, theta: np.ndarray, strength: float) -> Settled:
    basis = law(kind, 2)
    nothing = no_force(kind.period, (basis.place,))
    joint = Joint(
        kind.first.model, kind.windows, kind.period, (basis,), nothing.rest[:1], slice(None)
    )
    found = settled(joint, nothing, theta, np.array([strength]), exact=1e-9)
    assert found is not None
    return found


def test_slopes_are_those_of_the_motion_that_settles(kind: LineTrials) -> None:
    theta, strength, step = kind.first.part.theta, 0.5 * DRAG, 1e-4
    here = at(kind, theta, strength)
    slope, unit = slope_of(here)
    phi = here.joint.here.coordinate(theta)
    for index in range(len(theta)):
        ends = []
        for sign in (1, -1):
            moved = phi.copy()
            moved[index] += sign * step
            ends.append(at(kind, here.joint.here.natural(moved[None])[0], strength).residual)
        found = (ends[0] - ends[1]) / (2 * step)
        np.testing.assert_allclose(slope[:, index], found, atol=0.01 * np.linalg.norm(found))
    more, less = (at(kind, theta, strength + sign * step * unit[0]).residual for sign in (1, -1))
    found = (more - less) / (2 * step)
    np.testing.assert_allclose(slope[:, -1], found, atol=0.01 * np.linalg.norm(found))


def test_it_leads_back_from_somewhere_else(kind: LineTrials) -> None:
    part, drag = kind.first.part, law(kind, 2)
    theta = np.array([0.5, 0.5])
    back = kind._balance(part.model, (drag,), theta, np.array([0.5 * DRAG]))
    np.testing.assert_allclose(back.strength, DRAG, rtol=0.01)
    assert back.rms(kind.fitted) < 1.2


def test_the_limit_is_as_open_as_the_strength_of_a_force(kind: LineTrials) -> None:
    part = kind._balance(kind.first.model, (law(kind, 2),), kind.first.part.theta, np.zeros(1))
    state = kind._state(part, (Accepted("drag", law(kind, 2).title, "nonlinear", ""),))
    assert isinstance(state, BalancedState)
    (effect,) = state.accepted
    assert 0.003 < effect.limit_log_sd < 0.3
    assert effect.estimates["strength"].sd < 0.02 * DRAG


def test_a_mode_whose_mass_a_force_acts_on_is_needed(kind: LineTrials) -> None:
    """It had gone, and the force with no mass to act on was a KeyError."""
    first = kind.first.part
    mode = SecondMode.candidates(first.model, kind.etfe)[0]
    model = first.model.with_effect(mode)
    theta = np.append(first.theta, mode.starting_values(first.model, kind.etfe)[0])
    part = kind._balance(model, (), theta, np.zeros(0))
    here = [place.first for place in part.motions]
    on_the_mode = replace(law(kind, 2), place=next(p for p in part.motions if p.first == max(here)))
    part = kind._balance(model, (on_the_mode,), part.theta, np.zeros(1))
    force = Accepted("drag", on_the_mode.title, "nonlinear", "")
    state = kind._state(part, (accepted_with(mode), force))
    assert kind.without_needless(state, Meter()) is state
