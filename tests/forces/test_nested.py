"""Friction by a larger law than it has, and another force that this makes up for."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from on_the_bench import recorded_on, usual_noise

from bayeshaptic.diagnosis import acceptance
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.diagnosis.trials import beside
from bayeshaptic.diagnosis.trials.forces import called_for, nested
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.effects.laws import simplest
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.drag import Drag
from bayeshaptic.effects.nonlinear.friction import (
    CoulombFriction,
    DahlFriction,
    FrictionAlongTheWay,
    RisingFriction,
    StribeckFriction,
)
from bayeshaptic.effects.nonlinear.internal_force import LOAD, MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench


@pytest.mark.parametrize("law", [StribeckFriction, RisingFriction, FrictionAlongTheWay])
def test_the_simplest_law_of_friction_is_coulombs(law: Any) -> None:
    assert simplest(law(LOAD)) == CoulombFriction(LOAD)


@pytest.mark.parametrize("law", [CoulombFriction, DahlFriction, Drag])
def test_what_contains_no_simpler_law_has_none(law: Any) -> None:
    assert simplest(law(MOTOR)) is None


def test_the_excess_at_rest_has_an_end() -> None:
    """Of two forces that a falling friction made up for it had come to 29."""
    assert StribeckFriction.most["static_excess"] <= 6


@pytest.mark.parametrize(("score", "gained", "larger"), [(2, 50, 0), (9, 3, 0), (9, 50, 1)])
def test_a_larger_law_is_kept_where_it_is_worth_its_numbers(
    monkeypatch: pytest.MonkeyPatch, score: float, gained: float, larger: bool
) -> None:
    """Fitted from the simple law's end on, where it stands out there at all."""
    falls = StribeckFriction(MOTOR, {"static_excess": 2.0, "stribeck_velocity": 0.1})
    drag = Acting(Drag(MOTOR), 1.0)

    def point(forces: Any, theta: Any = None, expected: Any = None) -> Any:
        gain = gained if forces[0].effect.name == falls.name else 0.0
        return SimpleNamespace(
            forces=forces, theta=theta, motion=np.zeros(1), gain_fit=gain, gain_choose=gain
        )

    bench: Any = SimpleNamespace(point=point)
    hint = SimpleNamespace(effect=falls, strength=1.0, score=score)
    monkeypatch.setattr(nested, "departures", lambda *_: [hint])
    monkeypatch.setattr(nested, "fit_force", lambda _, found: found)
    found = nested.fit_nested(bench, point((Acting(falls, 0.5), drag)))
    assert found.forces[0].effect.name == (falls if larger else CoulombFriction).name
    assert found.forces[1] == drag
    plain = point((Acting(CoulombFriction(MOTOR), 0.5), drag))
    assert nested.fit_nested(bench, plain) is plain


def test_friction_and_a_drag_are_found_in_the_place_of_friction_that_falls(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of a held device; by itself that explained it, with 1.8 times the limit."""
    names = "coulomb_friction", "stribeck_friction", "drag"
    kinds = [kind for kind in effects("nonlinear") if kind.name in names]
    for module in (called_for, beside):
        monkeypatch.setattr(module, "effects", lambda family: kinds)
    bench = Bench.from_device("phantom", held=True)
    bench = bench.with_effect("coulomb_friction").with_effect("drag")
    recording = recorded_on(bench, usual_noise(bench, 20.0), seed=4)
    model = build_model("grasped", delay_s=bench.delay_s, period_s=recording.period_s)
    etfe = estimate_etfe(recording)
    state = State(etfe, least_squares(model, etfe))
    trials = nonlinear_trials(state, {"sign(v)", "v|v|"}, Meter())
    (falls,) = [trial for trial in trials if trial.name == "stribeck_friction"]
    (both,) = [trial for trial in trials if trial.name == "drag" and _forces(trial) == 2]
    assert falls.convincing and both.convincing
    assert (falls.size, both.size) == (3, 2)  # numbers of the forces that each adds
    near = [trial for trial in (falls, both) if acceptance.ties(both, trial)]
    assert min(near, key=acceptance.simplicity) is both
    sizes = {one.name: next(iter(one.estimates.values())).mean for one in both.state.accepted}
    for effect, size in zip(bench.effects, ("force", "coefficient"), strict=True):
        assert sizes[effect.name] == pytest.approx(getattr(effect, size), rel=0.1)


def _forces(trial: Trial) -> int:
    return len(trial.state.accepted)
