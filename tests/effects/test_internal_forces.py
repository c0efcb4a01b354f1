"""What a force adds to the motion, against the virtual bench, which shares no code with it."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from on_the_bench import recorded_on
from plain_stepping import step_through

from bayeshaptic.diagnosis.state import State, fit_part
from bayeshaptic.diagnosis.trials.forces.besides import Nothing
from bayeshaptic.diagnosis.trials.forces.simulation import Simulation
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.library import effect_class
from bayeshaptic.effects.nonlinear.internal_force import (
    CONNECTION,
    LOAD,
    MOTOR,
    Internal,
    forced_motion,
    numbers_of,
    steps,
)
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.models.response.motion import linear_motions
from bayeshaptic.recordings import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.rig.excitation import Prescribed

LHIFAM = Bench.from_device("lhifam")
SECONDS, SEED = 6.0, 4
PERIOD_S = 1e-3
STEP_S = PERIOD_S / 8

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
DAMPED_ALONG = (
    "damping_along_the_way",
    {},
    3e6,
    {"least_at": 0.4, "way_begins": -2e-3, "way_length": 4e-3},
    MOTOR,
)
COMPILED = (*FORCES[:-1], ALONG, DAMPED_ALONG)
OURS = {"hardening_connection": "hardening_spring"}
BENCHS = {"rising_friction": "stribeck_friction"}  # with less at rest than in motion


def driven(tryout: Tryout, force: Acting, theta: Any) -> Any:
    """What it does to the motor's position."""
    made = tryout.simulation
    return made.driven((force,), theta, made.added((force,), theta))


@cache
def command() -> Any:
    """White noise without a mean: a free device then does not run away."""
    force = simulate(LHIFAM, WhiteNoise(4.0, 300.0, 0.3, SECONDS), seed=SEED).force
    return Prescribed(force - force.mean())


def recorded(bench: Bench) -> Recording:
    return recorded_on(bench, command(), seed=SEED)


def plainly(mechanism: Any, forces: list[Internal]) -> Any:
    """As `forced_motion`, in plain NumPy."""
    linear = steps(mechanism, forces, STEP_S)
    motion = np.array([[force.position, force.velocity] for force in forces])
    laws = tuple(force.law.force for force in forces)
    sticks = [force.law.sticks for force in forces]
    return step_through(
        *linear, motion, STEP_S, 8, laws, sticks, *numbers_of([force.law for force in forces])
    )


@pytest.mark.parametrize("case", COMPILED, ids=[force[0] for force in COMPILED])
def test_compiled_steps_are_the_plain_ones(case: Any) -> None:
    name, _, strength, shape, place = case
    model = build_model("grasped", "lhifam")
    law = effect_class(OURS.get(name, name))(place, shape).law(strength, model, model.values)
    mechanism = model.system(model.values).mechanism
    wander = np.cumsum(np.random.default_rng(1).normal(size=800))
    velocity = wander * (0.005 if place == MOTOR else 1e-4)
    force = Internal(place, law, np.cumsum(velocity) * STEP_S, velocity)
    plain = plainly(mechanism, [force])[0]
    found = forced_motion(mechanism, [force], STEP_S, 8)[0]
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
    added = forced_motion(mechanism, [Internal(MOTOR, law, position, velocity)], STEP_S, 8)[0]
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
    monkeypatch.setattr(Simulation, "_besides", lambda *_: Nothing())
    tryout = Tryout(State(etfe, fit), with_force)
    found = driven(tryout, Acting(effect, strength), own.values)
    # Moves in 50 ms: a mean and a slope do not matter.
    found, added = (
        signal[50:] - signal[:-50] for signal in (found, with_force.position - without.position)
    )
    # Four encoder readings, each off by a uniform count; and what steps of an eighth of a period
    # are off by. Friction that turns only at their ends is 1.4 % off.
    counting = LHIFAM.encoder_resolution * np.sqrt(4 / 12)
    allowed = 1.2 * counting + 0.005 * added.std()
    assert np.std(found - added) < allowed, (np.std(found - added), counting, added.std())
    assert added.std() > 3 * counting  # or this would show nothing


def test_masses_that_rattle_in_a_gap_keep_to_the_measured_motion() -> None:
    """What a gap explains, it explains as well where the mechanism is a little off."""
    played = Bench.from_device("lhifam", held=True).with_effect("backlash")
    recording = recorded(played)
    etfe = estimate_etfe(recording)
    fit = least_squares(build_model("grasped", "lhifam"), etfe)
    tryout = Tryout(State(etfe, fit), recording)
    law = effect_class("backlash")(CONNECTION, {"damping_in_gap": 1.0})
    gap = Acting(law, played.effects[0].gap)  # type: ignore[attr-defined]
    truth = np.array([played.values[name] for name in fit.model.names])
    for _ in range(4):  # the slow motion of the hand is that beside what the gap did last
        found = tryout.as_it_is((gap,), truth)
    heavier = np.where(np.array(fit.model.names) == "m1", 1 + 1e-3, 1.0) * truth
    refitted = fit_part(fit.model, found.windows, truth)
    gains = [tryout.as_it_is((gap,), theta).gain_fit for theta in (heavier, refitted)]
    assert min(gains) > 0.95 * found.gain_fit > 0, (found.gain_fit, gains)


def test_a_force_with_which_the_mass_runs_away_explains_nothing() -> None:
    """And leaves no trace in what is tried after it."""
    recording = recorded(LHIFAM)
    etfe = estimate_etfe(recording)
    fit = least_squares(build_model("free", "lhifam"), etfe)
    tryout = Tryout(State(etfe, fit), recording)
    friction = Acting(effect_class("coulomb_friction")(MOTOR, {}), 0.6)
    before = driven(tryout, friction, fit.theta)
    softening = -1e3 * float(fit.theta[0]) * 1e4 / np.mean(recording.position**2)
    spring = Acting(effect_class("hardening_spring")(MOTOR, {}), softening)
    found = tryout.point((spring,), fit.theta)
    assert found.gain_fit == found.gain_choose == -np.inf
    after = driven(tryout, friction, fit.theta)
    assert np.array_equal(before, after)


def test_two_forces_act_in_the_motion_that_both_make() -> None:
    """Friction at the motor, drag at the load: against the bench, and each other's order."""
    bench = LHIFAM.with_effect("coulomb_friction", force=0.6)
    bench = bench.with_effect("drag", coefficient=150.0, on="m2")
    both, without = recorded(bench), recorded(LHIFAM)
    model = build_model("free", "lhifam")
    values = np.array([bench.values[name] for name in model.names])
    system = model.system(values)
    (x, v), (x2, v2) = linear_motions(system, both.force, PERIOD_S, (0, 1), 8)
    law = {
        place: effect_class(name)(place).law(strength, model, values)
        for name, place, strength in (("coulomb_friction", MOTOR, 0.6), ("drag", LOAD, 150.0))
    }
    friction, drag = Internal(MOTOR, law[MOTOR], x, v), Internal(LOAD, law[LOAD], x2, v2)

    def added(*forces: Internal) -> Any:
        return forced_motion(system.mechanism, forces, STEP_S, 8)

    found, truth = added(drag, friction).sum(axis=0), both.position - without.position
    apart = added(drag)[0] + added(friction)[0]

    def error(motion: Any) -> float:
        left = motion - truth
        return float(np.std(left[50:] - left[:-50]))

    moved = float(np.std(truth[50:] - truth[:-50]))
    assert error(found) < 0.03 * moved, (error(found), moved)
    assert error(apart) > 3 * error(found), (error(apart), error(found))
    plain = plainly(system.mechanism, [drag, friction])
    np.testing.assert_allclose(added(drag, friction), plain, rtol=0, atol=1e-9 * np.ptp(plain))


def test_an_odd_number_of_steps_a_period_is_refused() -> None:
    model = build_model("rigid", "lhifam")
    with pytest.raises(ValueError, match="even number"):
        forced_motion(model.system(model.values).mechanism, [], STEP_S, 3)
