"""What forces add under a hand, whose slow motion is measured: carried to other strengths."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces import besides
from bayeshaptic.diagnosis.trials.forces.along import slopes_along
from bayeshaptic.diagnosis.trials.forces.bench import ForceBench, Point
from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.fit import search_box
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.response.estimate import estimate_in_any_loop
from bayeshaptic.types import Floats
from benchmarks.through_reference import make

SEED = 4007  # a held LHIfAM under steps, 5.3 s


@cache
def held_in_a_loop() -> tuple[State, float, Floats]:
    """The base model fitted to all lines, the friction that acted, and the true parameters."""
    case = make(SEED)
    etfe = estimate_in_any_loop(replace(case.recording, reference=None))
    model = build_model("grasped", "lhifam", delay_s=case.bench.delay_s)
    fit = least_squares(model, etfe)
    truth = {**case.bench.values, "delay_s": case.bench.delay_s}
    theta = np.array([truth[name] for name in fit.model.names])
    return State(etfe, fit), case.friction * case.bench.force_rms, theta


def bench() -> ForceBench:
    state, _, _ = held_in_a_loop()
    assert state.etfe.unbroken is not None
    return ForceBench(state, state.etfe.unbroken)


def with_friction(here: ForceBench, friction: float, theta: Floats) -> Point:
    return here.as_it_is((Acting(CoulombFriction(MOTOR), friction),), theta)


def test_slopes_under_a_hand_are_those_of_a_motion_that_has_settled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(besides, "_SETTLED", 1e-4)
    monkeypatch.setattr(besides, "_MOST", 60)
    _, friction, theta = held_in_a_loop()
    here = bench()
    known = with_friction(here, friction, theta)
    added = np.stack([np.asarray(change.motion) for change in known.changes])
    scale, _, _ = search_box(here.model)
    phi, step = scale.coordinate(theta[None])[0], 0.2
    slopes = slopes_along(here, known.forces, theta, added, 0 * phi)
    for name in ("m2", "b2", "bh", "kh"):  # of the others friction's motion hardly depends
        number = here.model.names.index(name)
        both = []
        for side in (-1, 1):
            moved = scale.natural((phi + side * step * (np.arange(len(phi)) == number))[None])[0]
            both.append(with_friction(here, friction, moved).motion)
        found = here.at_lines((both[1] - both[0]) / (2 * step))
        assert np.linalg.norm(slopes[number, 0] - found) < 0.6 * np.linalg.norm(found), name


def test_friction_in_a_hand_is_found_in_a_loop() -> None:
    """From a fifth of it."""
    _, friction, theta = held_in_a_loop()
    here = bench()
    start = here.point((Acting(CoulombFriction(MOTOR), 0.2 * friction),), here.state.fit.theta)
    found = fit_force(here, start)
    assert found.gain_fit > with_friction(here, friction, theta).gain_fit
    assert found.strength / friction == pytest.approx(1.0, abs=0.1)
