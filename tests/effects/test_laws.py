"""The table of laws: one new law, written once, is taken by everything that needs laws."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
from plain_stepping import step_through

from bayeshaptic.diagnosis.feedback.inverse_dynamics import inverse_dynamics
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.residuals.columns import force_test
from bayeshaptic.diagnosis.residuals.residual import ForceSeen
from bayeshaptic.effects import laws, registry
from bayeshaptic.effects.library import effect_class, effects
from bayeshaptic.effects.nonlinear.internal_force import (
    MOTOR,
    Internal,
    Law,
    Place,
    forced_motion,
    steps,
)
from bayeshaptic.effects.nonlinear.protocol import Motion, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import VELOCITY, Shape, Usual
from bayeshaptic.models import Model, build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.types import Floats

SLOW, PERIOD_S = 0.05, 1e-3


def rounded(x, v, last, gain, before, step_s, constants):  # type: ignore[no-untyped-def]
    return -constants[0] * math.tanh(v / constants[1])


class RoundedFriction(NonlinearEffect):
    """Friction that does not stick."""

    name = "rounded_friction"
    title = "friction that does not stick"
    strength = ("friction_force", "force")
    over = (VELOCITY,)
    tests = (Shape("tanh(v)", "a force like tanh(v)", VELOCITY, lambda v: -np.tanh(v)),)

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        return (Shape("rounded", cls.title, VELOCITY, lambda v: -np.tanh(v / SLOW)),)

    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        return np.array([0.1, 1.0])

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        return Law(rounded, (strength, SLOW))


@pytest.fixture(autouse=True)
def with_the_law(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(registry._registered, RoundedFriction.name, RoundedFriction)
    yield


def test_the_residual_is_tested_for_it_and_calls_for_it() -> None:
    assert "tanh(v)" in laws.tested()
    assert laws.variables({"tanh(v)", "excess noise"}) == {VELOCITY, "excess noise"}
    assert effect_class("rounded_friction")().called_for({VELOCITY})


def test_harmonic_balance_tries_it() -> None:
    v = 0.1 * np.sin(np.linspace(0, 2 * np.pi, 100, endpoint=False))
    (basis,) = force_candidates(build_model("free", "lhifam"), {MOTOR: Motion(v, v, v)})[
        "rounded_friction"
    ]
    np.testing.assert_allclose(basis.force(Motion(v, v, v)), -np.tanh(v / SLOW))
    assert basis.unit == "N" and basis.title == "friction that does not stick"


def test_inverse_dynamics_fits_it() -> None:
    t = PERIOD_S * np.arange(8000)
    x = 0.1 * np.sin(2 * np.pi * 0.5 * t) + 0.03 * np.sin(2 * np.pi * 1.3 * t)
    v, a = np.gradient(x, PERIOD_S), np.gradient(np.gradient(x, PERIOD_S), PERIOD_S)
    recording = recording_from_arrays(3.0 * a + 5.0 * v + 2.0 * np.tanh(v / SLOW), x, PERIOD_S)
    found = inverse_dynamics(recording, terms=("rounded",))
    assert found["rounded"][0] == pytest.approx(2.0, rel=0.01)


def test_it_is_simulated() -> None:
    model = build_model("free", "lhifam")
    mechanism = model.system(model.values).mechanism
    v = 0.1 * np.sin(np.arange(400) / 20)
    law = effect_class("rounded_friction")().law(0.5, model, model.values)
    found = forced_motion(mechanism, [Internal(MOTOR, law, v, v)], PERIOD_S / 8, 8)
    plain = step_through(
        *steps(mechanism, [Internal(MOTOR, law, v, v)], PERIOD_S / 8),
        np.array([[v, v]]),
        PERIOD_S / 8,
        8,
        (rounded,),
        [False],
        np.array([0.5, SLOW]),
        (0,),
    )
    np.testing.assert_allclose(found, plain, rtol=0, atol=1e-10 * np.abs(plain).max())


def test_names_in_the_table_mean_one_thing_each() -> None:
    usual = Usual(0.1, 0.01, "m")
    names = [shape.name for kind in effects("nonlinear") for shape in kind.tests]
    assert all(names.count(name) in (1, 3) for name in names)  # actuators share their test
    shapes = [shape for _, shape in laws.fitted(MOTOR, usual)] + laws.corrections(usual)
    terms = [shape.name for shape in shapes]
    assert len(terms) == len(set(terms))


def test_a_lag_that_nobody_knows_is_in_the_errors_of_inverse_dynamics() -> None:
    """A mass in a clean loop that follows tones: its damping was 13 standard errors off."""
    mass, damping, step_s = 0.5, 2.0, 1e-4
    t = 1e-3 * np.arange(3000)
    target = 0.02 * sum(np.sin(2 * np.pi * f * t + f) for f in (0.9, 1.7, 2.9, 4.3, 5.7))
    x = v = 0.0
    position, force = np.zeros((2, len(t)))
    for k in range(len(t)):
        position[k] = 1e-5 * np.round(x / 1e-5)
        rate = (position[k] - position[k - 1]) / 1e-3
        force[k] = 1500.0 * (target[k] - position[k]) - 30.0 * rate
        for _ in range(10):  # the command of the sample before: a delay of one
            v += step_s * (force[k - 1] - damping * v) / mass
            x += step_s * v
    found = inverse_dynamics(recording_from_arrays(force, position, 1e-3), terms=())
    for name, truth in (("mass", mass), ("damping", damping)):
        value, sd = found[name]
        assert abs(value - truth) < 2 * sd < truth, name


def test_a_force_elsewhere_than_at_the_motor_is_named_in_words() -> None:
    """A warning told of "a force like clipped stretch", and of sign(v2)."""
    seen = ForceSeen(1.0, 0.1, 1.0)
    said = {name: force_test(name, 5.0, seen).text for name in laws.tested()}
    assert said["sign(v)"].startswith("a force like sign(v) stands 5.0")
    assert said["sign(v2)"].startswith("a force like dry friction at the load stands")
    assert said["clipped stretch"].startswith("a force like a gap in the connection stands")
