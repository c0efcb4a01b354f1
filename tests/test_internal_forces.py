"""What a force adds to the motion, against the virtual bench, which shares no code with it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from plain_stepping import step_through

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.force_bench import ForceBench
from bayeshaptic.effects.library import effect_class
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, MOTOR, forced_motion, steps
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.etfe import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.rig.excitation import Prescribed

LHIFAM = Bench.from_device("lhifam")
SECONDS, SEED = 6.0, 4
STEP_S = 1e-3 / 8

# Name, fields on the bench, strength, shape, place.
FORCES: tuple[tuple[str, dict[str, float], float, dict[str, float], Any], ...] = (
    ("coulomb_friction", {"force": 0.6}, 0.6, {}, MOTOR),
    (
        "stribeck_friction",
        {"force": 0.5, "static": 0.8, "velocity": 0.02},
        0.5,
        {"static_excess": 0.6, "stribeck_velocity": 0.02},
        MOTOR,
    ),
    (
        "rising_friction",
        {"force": 0.8, "static": 0.32, "velocity": 0.02},
        0.8,
        {"lack_at_rest": 0.6, "rising_velocity": 0.02},
        MOTOR,
    ),
    (
        "dahl_friction",
        {"force": 0.6, "stiffness": 1500.0},
        0.6,
        {"presliding_distance": 4e-4},
        MOTOR,
    ),
    ("drag", {"coefficient": 150.0}, 150.0, {}, MOTOR),
    ("hardening_connection", {"stiffness": 1.5e11}, 1.5e11, {}, CONNECTION),
    ("backlash", {"gap": 4e-5, "free_damping": 0.0}, 4e-5, {"damping_in_gap": 1.0}, CONNECTION),
    ("actuator_saturation", {"limit": 5.0}, 5.0, {}, MOTOR),
)
ALONG = (
    "friction_along_the_way",
    {},
    0.6,
    {"friction_ratio": 3.0, "way_middle": 2e-4, "way_span": 2e-3},
    MOTOR,
)
COMPILED = (*FORCES[:-1], ALONG)
OURS = {"hardening_connection": "hardening_spring"}
BENCHS = {"rising_friction": "stribeck_friction"}  # with less at rest than in motion


@cache
def command() -> Any:
    """White noise without a mean: a free device then does not run away."""
    force = simulate(LHIFAM, WhiteNoise(4.0, 300.0, 0.3, SECONDS), seed=SEED).force
    return Prescribed(force - force.mean())


def recorded(bench: Bench) -> Recording:
    made = simulate(bench, command(), seed=SEED)
    return recording_from_arrays(**made.signals, encoder_resolution=bench.encoder_resolution)


@pytest.mark.parametrize("case", COMPILED, ids=[force[0] for force in COMPILED])
def test_compiled_steps_are_the_plain_ones(case: Any) -> None:
    name, _, strength, shape, place = case
    model = build_model("grasped", "lhifam")
    law = effect_class(OURS.get(name, name))(place, shape).law(strength, model, model.values)
    mechanism = model.system(model.values).mechanism
    wander = np.cumsum(np.random.default_rng(1).normal(size=800))
    velocity = wander * (0.005 if place == MOTOR else 1e-4)
    motion = np.cumsum(velocity) * STEP_S, velocity, STEP_S, 8
    constants = np.array(law.constants, float)
    plain = step_through(*steps(mechanism, place, STEP_S), *motion, law.force, constants)
    found = forced_motion(mechanism, place, law, *motion)
    # What rounding differs by, over eight hundred steps.
    np.testing.assert_allclose(found, plain, rtol=0, atol=1e-10 * np.abs(plain).max())
    assert np.ptp(plain) > 0


def test_dry_friction_holds_a_mass_still() -> None:
    model = build_model("rigid", "lhifam")
    mechanism = model.system(model.values).mechanism
    law = effect_class("coulomb_friction")(MOTOR).law(1.0, model, model.values)
    # Moved to and fro by half of what friction can hold, were there no friction.
    rate, time = 2 * np.pi * 5.0, STEP_S * np.arange(4000)
    size = 0.5 / float(mechanism.masses[0][0]) / rate
    velocity, position = size * np.sin(rate * time), size / rate * (1 - np.cos(rate * time))
    added = forced_motion(mechanism, MOTOR, law, position, velocity, STEP_S, 8)
    # Velocities are exact at the ends of the steps: the trapezoidal rule is off by (w h)^2 / 12.
    assert np.abs(added + position[::8]).max() < (rate * STEP_S) ** 2 * position.max()


@pytest.mark.parametrize(
    ("name", "fields", "strength", "shape", "place"), FORCES, ids=[force[0] for force in FORCES]
)
def test_added_motion_is_that_of_the_bench(
    name: str,
    fields: dict[str, float],
    strength: float,
    shape: dict[str, float],
    place: Any,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    with_force = recorded(LHIFAM.with_effect(BENCHS.get(name, name), **fields))
    without = recorded(LHIFAM)
    etfe = estimate_etfe(with_force)
    model = build_model("free", "lhifam")
    fit = least_squares(model, etfe, start=model.values)
    own = fit.model
    assert own.values is not None
    effect = effect_class(OURS.get(name, name))(place, shape)
    # It begins at rest, and no constant force acts: there is no drift to look for.
    monkeypatch.setattr(ForceBench, "_drift", lambda bench, besides, theta: np.zeros(len(besides)))
    bench = ForceBench(State(etfe, fit), with_force)
    found = bench.added_motion(effect, strength, own.values)
    # Moves in 50 ms: a mean and a slope do not matter.
    found, added = (
        signal[50:] - signal[:-50] for signal in (found, with_force.position - without.position)
    )
    # Four encoder readings, each off by a uniform count; and the eighth of a period in which dry
    # friction turns, twice an oscillation of the mode (103 Hz): 2.6 %.
    counting = LHIFAM.encoder_resolution * np.sqrt(4 / 12)
    allowed = 1.2 * counting + 0.026 * added.std()
    assert np.std(found - added) < allowed, (np.std(found - added), counting, added.std())
    assert added.std() > 3 * counting  # or this would show nothing


def test_a_force_with_which_the_mass_runs_away_explains_nothing() -> None:
    """And leaves no trace in what is tried after it."""
    recording = recorded(LHIFAM)
    etfe = estimate_etfe(recording)
    fit = least_squares(build_model("free", "lhifam"), etfe)
    bench = ForceBench(State(etfe, fit), recording)
    before = bench.added_motion(effect_class("coulomb_friction")(MOTOR, {}), 0.6, fit.theta)
    softening = -1e3 * float(fit.theta[0]) * 1e4 / np.mean(recording.position**2)
    found = bench.point(effect_class("hardening_spring")(MOTOR, {}), softening, fit.theta)
    assert found.gain_fit == found.gain_choose == -np.inf
    after = bench.added_motion(effect_class("coulomb_friction")(MOTOR, {}), 0.6, fit.theta)
    assert np.array_equal(before, after)
