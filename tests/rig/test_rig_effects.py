"""Effects on the virtual bench: each against what it must do."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from on_the_bench import usual_noise
from plain_bench_stepper import plainly
from rig_reference import Transfer, continuous, sampled
from scipy.integrate import solve_ivp

from bayeshaptic.errors import InputError
from bayeshaptic.rig import (
    REGISTRY,
    Bench,
    Effect,
    Multisine,
    WhiteNoise,
    critical_limit,
    register,
    run_wall,
    simulate,
)
from bayeshaptic.rig.dynamics.stepper import Stepper
from bayeshaptic.rig.dynamics.structure import FRAME, Link, Structure

PERIOD = 1e-3
HELD = Bench.from_device("lhifam", held=True)
BLOCK = Bench("rigid", {"m": 2.0, "b": 0.0}, force_rms=1.0)


def hung(mass: float, frequency_hz: float, damping_ratio: float) -> Transfer:
    """Dynamic stiffness of a mass hung on by a spring and a damper."""
    w = 2 * np.pi * frequency_hz
    return lambda s: (
        mass * s**2 * (2 * damping_ratio * w * s + w**2) / (s**2 + 2 * damping_ratio * w * s + w**2)
    )


def reflex(s: np.ndarray) -> np.ndarray:
    return (60.0 + 8.0 * s) * np.exp(-0.0305 * s) / (1 + 0.01 * s)


VALUES = dict(HELD.values)
LINEAR: dict[str, tuple[dict[str, object], Transfer, float]] = {
    "second_mode": (
        {"mass_ratio": 0.2, "frequency_hz": 110.0, "damping_ratio": 0.03},
        continuous(VALUES, m1=hung(0.2 * 0.2, 110.0, 0.03)),
        1e-6,
    ),
    "second_mode on m2": (
        {"mass_ratio": 0.2, "frequency_hz": 110.0, "damping_ratio": 0.03, "on": "m2"},
        continuous(VALUES, m2=hung(0.2 * 3.78, 110.0, 0.03)),
        1e-6,
    ),
    "centring_stiffness": (
        {"stiffness": 300.0},
        continuous(VALUES, m1=lambda s: 300.0 + 0 * s),
        1e-6,
    ),
    "extra_delay": (
        {"delay_s": 1.35e-3},
        lambda s: continuous(VALUES)(s) * np.exp(-1.35e-3 * s),
        1e-6,
    ),
    "actuator_lag": (
        {"time_constant_s": 0.4e-3, "order": 3.0},
        lambda s: continuous(VALUES)(s) / (1 + 0.4e-3 * s) ** 3,
        1e-6,
    ),
    "position_filter": (
        {"cutoff_hz": 150.0},
        lambda s: continuous(VALUES)(s) / (1 + s / (300 * np.pi)),
        1e-6,
    ),
    "position_filter of order 2": (
        {"cutoff_hz": 150.0, "order": 2, "damping_ratio": 0.6},
        lambda s: continuous(VALUES)(s) / (1 + 1.2 * s / (300 * np.pi) + (s / (300 * np.pi)) ** 2),
        1e-6,
    ),
    # A late force is joined by straight lines over 1/8 ms: (w/8000)^2/12 of it is missing.
    "reflex": (
        {"stiffness": 60.0, "damping": 8.0, "delay_s": 0.0305, "time_constant_s": 0.01},
        continuous(VALUES, hand=reflex),
        1e-5,
    ),
}


@pytest.mark.parametrize("case", LINEAR)
def test_linear_effects_have_their_frequency_response(case: str) -> None:
    changes, response, tolerance = LINEAR[case]
    bench = HELD.quiet().with_effect(case.split()[0], **changes)
    excitation = Multisine(4.0, 4.0, 400.0, spacing_hz=4.0, periods=1)
    recording = simulate(bench, excitation, settle_s=6.0 if case == "reflex" else 16.0)
    lines = excitation.lines_hz(PERIOD)
    at = np.round(lines / 4.0).astype(int)
    got = np.fft.rfft(recording.position)[at] / np.fft.rfft(recording.force)[at]
    expected = sampled(response, lines, PERIOD, bench.delay_s)
    assert np.max(np.abs(got / expected - 1)) < tolerance
    plain = sampled(continuous(VALUES), lines, PERIOD, bench.delay_s)
    assert np.max(np.abs(expected / plain - 1)) > 0.05


def test_compliant_base_moves_under_the_whole_device() -> None:
    bench = Bench("rigid", {"m": 2.0, "b": 3.0}, delay_s=2e-4).with_effect(
        "base_compliance", mass_ratio=3.0, frequency_hz=20.0, damping_ratio=0.1
    )
    w = 2 * np.pi * 20.0

    def response(s: np.ndarray) -> np.ndarray:
        both = 1 / (2.0 * s**2) + 1 / (6.0 * (s**2 + 0.2 * w * s + w**2))
        return both / (1 + 3.0 * s * both)

    excitation = Multisine(1.0, 4.0, 400.0, spacing_hz=4.0, periods=1)
    recording = simulate(bench, excitation, settle_s=16.0)
    at = np.arange(1, 101)
    got = np.fft.rfft(recording.position)[at] / np.fft.rfft(recording.force)[at]
    expected = sampled(response, 4.0 * at, PERIOD, 2e-4)
    assert np.max(np.abs(got / expected - 1)) < 1e-6


def test_structural_damping_loses_the_same_at_every_frequency() -> None:
    values = {"m1": 0.2, "b1": 0.0, "bc": 0.0, "kc": 6e4, "m2": 4.0, "b2": 0.0}
    plant = Bench("free", values).with_effect("structural_damping", loss_factor=0.2).plant()
    natural = np.sqrt(6e4 * (1 / 0.2 + 1 / 4.0))
    s = 1j * natural * np.array([1.0, 0.2, 0.4, 2.5, 5.0])
    identity = np.eye(plant.states)
    motion = np.array(
        [plant.position @ np.linalg.solve(v * identity - plant.dynamics, plant.motor) for v in s]
    )
    # The connection's complex stiffness, solved from the response of two masses joined by it.
    stiffness = 4.0 * s**2 * (1 - motion * 0.2 * s**2) / (motion * 4.2 * s**2 - 1)
    assert stiffness[0] == pytest.approx(6e4 * (1 + 0.2j), rel=1e-9)
    np.testing.assert_allclose(stiffness.imag, 0.2 * 6e4, rtol=0.05)
    assert np.all(np.diff(stiffness.real[[1, 2, 0, 3, 4]]) > 0)


def test_block_slides_to_a_stop_and_stays() -> None:
    bench = BLOCK.with_effect("coulomb_friction", force=3.0)
    position = simulate(bench, np.zeros(600), start={"m1": (0.0, 0.5)}).position
    time_s, stop = np.arange(600) * PERIOD, 0.5 * 2.0 / 3.0
    expected = np.where(time_s < stop, 0.5 * time_s - 0.75 * time_s**2, 0.5 * 2.0 * 0.5**2 / 3.0)
    # The stop is found to 1/8192 ms.
    np.testing.assert_allclose(position, expected, atol=1e-9)
    assert np.all(position[335:] == position[335])
    # All of the kinetic energy went into friction.
    assert 3.0 * position[-1] == pytest.approx(0.5 * 2.0 * 0.5**2, rel=1e-8)


def test_block_sticks_below_the_threshold_and_slides_above() -> None:
    bench = BLOCK.with_effect("coulomb_friction", force=3.0)
    below = simulate(bench, 2.999 * np.sin(np.arange(2000) / 40))
    assert not below.position.any()
    above = simulate(bench, np.full(500, 5.0)).position
    np.testing.assert_allclose(above, 0.5 * np.arange(500.0) ** 2 * PERIOD**2, rtol=1e-11)
    push = np.concatenate([np.full(200, 5.0), np.full(900, 2.5)])
    tail = simulate(bench, push).position
    # 0.2 m/s from the push, then slowed by 0.25 m/s^2 until it stands.
    assert tail[-1] == pytest.approx(0.02 + 0.2**2 / (2 * 0.25), rel=1e-7)
    assert tail[1000] == pytest.approx(tail[200] + 0.2 * 0.8 - 0.125 * 0.64, rel=1e-7)


def brute_force(bench: Bench, friction: float, force: np.ndarray, steps: int) -> np.ndarray:
    """Position of m1 by explicit steps of T/steps, friction holding what it can hold."""
    plant = bench.plant()
    h, x, out = PERIOD / steps, np.zeros(plant.states), np.empty(len(force))
    place, velocity = plant.places["m1"]
    mass = 1 / plant.motor[velocity]
    transition = (
        np.eye(plant.states) + h * plant.dynamics + h**2 / 2 * (plant.dynamics @ plant.dynamics)
    )
    column = h * plant.motor + h**2 / 2 * plant.dynamics @ plant.motor
    for k, u in enumerate(force):
        out[k] = x[place]
        for _ in range(steps):
            following = transition @ x + column * u
            rub = min(max(-following[velocity] * mass / h, -friction), friction)
            x = following + column * rub
    return out


def test_friction_in_a_vibrating_device_is_that_of_small_steps() -> None:
    bench = Bench.from_device("lhifam", delay_s=0.0).quiet()
    rubbing = bench.with_effect("coulomb_friction", force=1.0)
    force = simulate(bench, WhiteNoise(4.0, 200.0, seconds=0.3), seed=3).force
    got, fine = (simulate(rubbing, force, substeps=n).position for n in (8, 64))
    scale = np.std(got)
    assert np.max(np.abs(got - fine)) < 2e-5 * scale
    # Explicit steps of 0.6 us lose their first order at every reversal: good to some 1e-4.
    expected = brute_force(bench, 1.0, force[:80], 1600)
    assert np.max(np.abs(got[:80] - expected)) < 2e-3 * np.std(expected)
    assert np.max(np.abs(simulate(bench, force[:80]).position - expected)) > np.std(expected)


def test_friction_takes_four_of_its_deflections_a_swing() -> None:
    bench = BLOCK.with_effect("centring_stiffness", stiffness=200.0)
    bench = bench.with_effect("coulomb_friction", force=0.5)
    position = simulate(bench, np.zeros(7000), start={"m1": (0.101, 0.0)}).position
    # The swings (10 rad/s) lose 2 x 0.5/200 m at each turn and end at 1 mm, where friction holds.
    half_swing = round(1000 * np.pi / 10)
    for turn in range(1, 20):
        at = turn * half_swing
        expected = (-1) ** turn * (0.101 - 0.005 * turn)
        turning = position[at - 20 : at + 20]
        assert turning[np.argmax(np.abs(turning))] == pytest.approx(expected, abs=3e-6)
    assert position[-1] == pytest.approx(0.001, abs=1e-7)
    assert np.all(position[6400:] == position[-1])


def test_stribeck_friction_holds_more_than_it_brakes() -> None:
    bench = BLOCK.with_effect("stribeck_friction", force=2.0, static=4.0, velocity=0.05)
    assert not simulate(bench, np.full(500, 3.9)).position.any()
    moving = simulate(bench, np.full(1000, 3.9), start={"m1": (0.0, 0.3)})
    solution = solve_ivp(
        lambda t, y: [y[1], (3.9 - 2.0 - 2.0 * np.exp(-((y[1] / 0.05) ** 2))) / 2.0],
        (0, 0.999),
        [0.0, 0.3],
        rtol=1e-10,
        atol=1e-12,
        t_eval=np.arange(1000) * PERIOD,
    )
    np.testing.assert_allclose(moving.position, solution.y[0], atol=1e-6)


def test_dahl_friction_is_a_spring_at_first() -> None:
    bench = replace(BLOCK, values={"m": 2.0, "b": 400.0}).with_effect(
        "dahl_friction", force=3.0, stiffness=2e4
    )
    ramp = np.minimum(np.arange(6000) / 3000.0, 1.0) * 2.4
    position = simulate(bench, ramp).position
    assert position[-1] == pytest.approx(-3.0 / 2e4 * np.log(1 - 2.4 / 3.0), rel=1e-6)
    assert np.std(simulate(bench, ramp * 1.5).position) > 10 * np.std(position)


def test_hardening_spring_is_duffings() -> None:
    bench = replace(BLOCK, values={"m": 2.0, "b": 1.0})
    start = {"m1": (0.02, 0.0)}
    solution = solve_ivp(
        lambda t, y: [y[1], (-1.0 * y[1] - 4e6 * y[0] ** 3) / 2.0],
        (0, 0.999),
        [0.02, 0.0],
        rtol=1e-11,
        atol=1e-13,
        t_eval=np.arange(1000) * PERIOD,
    )
    errors = []
    for substeps in (4, 8, 16):
        changed = bench.with_effect("hardening_spring", stiffness=4e6)
        position = simulate(changed, np.zeros(1000), start=start, substeps=substeps).position
        errors.append(np.max(np.abs(position - solution.y[0])) / 0.02)
    assert errors[1] < 1e-4
    # Second order: half the step, a quarter of the error.
    assert 3.5 < errors[0] / errors[1] < 4.5 and 3.5 < errors[1] / errors[2] < 4.5


@pytest.mark.parametrize("effect", ["hardening_connection", "backlash"])
def test_springs_without_dampers_keep_the_energy(effect: str) -> None:
    values = {"m1": 0.2, "b1": 0.0, "bc": 0.0, "kc": 6e4, "m2": 4.0, "b2": 0.0}
    changes = {"stiffness": 5e11} if effect == "hardening_connection" else {"gap": 2e-4}
    bench = Bench("free", values).with_effect(effect, **changes)
    recording = simulate(bench, np.zeros(2000), start={"m1": (0.0, 0.3)}, substeps=16)
    velocity = np.gradient(recording.position, PERIOD)
    # m1 swings on against m2 as fast as in the beginning; m2 takes over momentum, not energy.
    early, late = (np.ptp(velocity[part]) for part in (slice(10, 500), slice(-500, -10)))
    assert late == pytest.approx(early, rel=0.03)
    plain = simulate(Bench("free", values), np.zeros(2000), start={"m1": (0.0, 0.3)})
    turns = [
        np.sum(np.diff(np.sign(r.position - _trend(r.position))) != 0) for r in (recording, plain)
    ]
    assert (turns[0] > turns[1]) == (effect == "hardening_connection")


def _trend(position: np.ndarray) -> np.ndarray:
    index = np.arange(len(position))
    return np.polyval(np.polyfit(index, position, 1), index)


def test_inside_the_play_nothing_is_transmitted() -> None:
    values = {"m1": 0.2, "b1": 0.0, "bc": 50.0, "kc": 6e4, "m2": 4.0, "b2": 0.0}
    bench = Bench("free", values).with_effect("backlash", gap=1e-3, free_damping=1.0)
    position = simulate(bench, np.zeros(60), start={"m1": (-0.9e-3, 0.02)}).position
    expected = -0.9e-3 + 0.02 * np.arange(60) * PERIOD
    np.testing.assert_allclose(position, expected, atol=1e-3 * 0.3e-3)


def test_ripple_and_drag_act_at_their_place() -> None:
    bench = replace(BLOCK, values={"m": 2.0, "b": 50.0})
    trapped = simulate(
        bench.with_effect("force_ripple", amplitude=2.0, pitch=0.01, phase=0.0), np.full(3000, 1.0)
    )
    # Rest where the ripple balances the force: sin(2 pi x/0.01) = -1/2 on the stable flank.
    assert trapped.position[-1] == pytest.approx(0.01 * 7 / 12, rel=1e-6)
    dragged = simulate(
        replace(BLOCK, values={"m": 2.0, "b": 0.0}).with_effect("drag", coefficient=10.0),
        np.full(6000, 2.5),
    )
    assert np.diff(dragged.position)[-1] / PERIOD == pytest.approx(0.5, rel=1e-6)


def test_command_effects_change_what_acts_and_not_what_is_written() -> None:
    bench = HELD.quiet()
    plain = simulate(bench, seed=3)
    saturated = simulate(bench.with_effect("actuator_saturation", limit=5.0), seed=3)
    np.testing.assert_array_equal(saturated.force, plain.force)
    clipped = simulate(bench, np.clip(plain.force, -5.0, 5.0), seed=3)
    np.testing.assert_allclose(saturated.position, clipped.position, atol=1e-15)
    drift = simulate(bench.with_effect("gain_drift", ratio=0.5), np.ones(20000))
    assert drift.position[-1] == pytest.approx(0.5 / 133.48, rel=0.03)
    hum = simulate(bench.with_effect("mains_tone", amplitude=0.2, on="force"), np.zeros(5000))
    assert np.argmax(np.abs(np.fft.rfft(hum.position[3000:] * np.hanning(2000)))[5:]) + 5 == 100


def test_sensor_effects_change_what_is_read() -> None:
    plain = simulate(HELD, seed=3)
    coarse = simulate(HELD.with_effect("quantisation", count=1e-4), seed=3).position
    np.testing.assert_allclose(coarse / 1e-4, np.round(coarse / 1e-4), atol=1e-9)
    assert np.max(np.abs(coarse - plain.position)) < 0.5e-4 + 1.6e-6
    clipped = simulate(HELD.with_effect("position_clipping", limit=3e-3), seed=3).position
    assert np.max(np.abs(clipped)) == pytest.approx(3e-3, abs=3.2e-6)
    assert np.mean(np.abs(clipped) == np.max(clipped)) > 0.05
    tone = simulate(
        HELD.with_effect("mains_tone", amplitude=1e-4, frequency_hz=60.0, phase=0.0), seed=3
    )
    added = tone.position - plain.position
    expected = 1e-4 * np.sin(2 * np.pi * 60.0 * plain.time_s)
    assert np.max(np.abs(added - expected)) <= 3.15e-6
    late = simulate(HELD.quiet().with_effect("sample_jitter", sd_s=5e-5, stamped=True), seed=3)
    early = simulate(HELD.quiet(), seed=3)
    jitter = late.time_s - early.time_s
    assert np.std(jitter) == pytest.approx(5e-5, rel=0.02)
    velocity = np.gradient(early.position, PERIOD)
    moved = late.position - early.position
    assert np.std(moved - jitter * velocity) < 0.2 * np.std(moved)
    unstamped = simulate(HELD.quiet().with_effect("sample_jitter", sd_s=5e-5), seed=3)
    np.testing.assert_array_equal(unstamped.time_s, early.time_s)
    np.testing.assert_array_equal(unstamped.position, late.position)


def test_logger_effects_repeat_and_lose_samples() -> None:
    bench = replace(HELD, encoder_resolution=0.0)
    plain = simulate(bench, seed=3)
    held = simulate(bench.with_effect("held_samples", probability=0.02, longest=3), seed=3)
    repeats = np.flatnonzero(np.diff(held.position) == 0)
    # 2 % of the samples begin a run of 2 on average.
    assert len(repeats) == pytest.approx(0.04 * 30000, rel=0.1)
    changed = np.flatnonzero(held.position != plain.position)
    np.testing.assert_array_equal(changed, repeats + 1)
    np.testing.assert_array_equal(held.force, plain.force)
    dropped = simulate(bench.with_effect("dropped_samples", probability=0.01), seed=3)
    assert 29600 < len(dropped.time_s) < 29800
    rows = np.round(dropped.time_s / PERIOD).astype(int)
    np.testing.assert_array_equal(dropped.position, plain.position[rows])
    np.testing.assert_array_equal(dropped.force, plain.force[rows])
    assert len(dropped.true_position) == 30000


def test_a_grip_that_changes_at_once_is_one_hand_and_then_another() -> None:
    bench = HELD.quiet()
    drifting = bench.with_effect("grip_drift", ratio=2.0, which=("kh", "ks"), shape="step")
    other = replace(bench, values={**VALUES, "kh": 2 * 133.48, "ks": 2 * 56.03e3})
    force = simulate(bench, seed=1).force
    got, before, after = (simulate(b, force).position for b in (drifting, bench, other))
    np.testing.assert_allclose(got[:14900], before[:14900], atol=1e-15)
    # What the first hand left behind dies with bh/(2 (m1+m2+mh)) = 1.7 1/s: e^-17 after 10 s.
    np.testing.assert_allclose(got[25100:], after[25100:], atol=1e-4 * np.std(after))
    ramp = simulate(replace(drifting, effects=(replace(drifting.effects[0], shape="ramp"),)), force)
    assert np.std(ramp.position[:1000] - before[:1000]) < 0.02 * np.std(before[:1000])
    assert np.std(ramp.position[-3000:] - before[-3000:]) > 0.2 * np.std(before)
    worst = min(critical_limit(b).stiffness for b in (bench, other))
    assert critical_limit(drifting).stiffness == pytest.approx(worst, rel=1e-9)


@pytest.mark.parametrize(("device", "held"), [("lhifam", True), ("phantom", False)])
def test_every_effect_shows_at_its_typical_strength(device: str, held: bool) -> None:
    bench = Bench.from_device(device, held=held)
    excitation = usual_noise(bench, 3.0)
    plain = simulate(bench, excitation, seed=6)
    needs_hand = {"reflex", "grip_drift"}
    for name in sorted(REGISTRY):
        if name in needs_hand and not held:
            with pytest.raises(InputError, match="hand|grasped"):
                bench.with_effect(name)
            continue
        recording = simulate(bench.with_effect(name), excitation, seed=6)
        assert np.all(np.isfinite(recording.position)), name
        rows = np.round(recording.time_s / PERIOD).astype(int)
        if name == "dropped_samples":
            assert len(rows) <= len(plain.time_s)
            continue
        assert np.any(recording.position != plain.position[rows]), name
        assert np.std(recording.position) < 10 * np.std(plain.position), name


def test_effects_combine() -> None:
    names = ("grip_drift", "coulomb_friction", "actuator_lag", "hardening_spring", "reflex")
    bench = HELD
    for name in names:
        bench = bench.with_effect(name)
    bench = bench.with_effect("coulomb_friction", force=0.2, on="m2")
    excitation = WhiteNoise(4.0, 300.0, 0.3, seconds=2.0)
    together = simulate(bench, excitation, seed=1).position
    for left_out in range(len(bench.effects)):
        others = bench.effects[:left_out] + bench.effects[left_out + 1 :]
        assert (
            np.std(simulate(replace(bench, effects=others), excitation, seed=1).position - together)
            > 1e-5
        )


def test_friction_does_not_raise_the_limit_but_quietens_the_wall() -> None:
    bench = Bench.from_device("phantom").quiet()
    rubbing = bench.with_effect("coulomb_friction", force=0.01)
    limit = bench.true_critical_stiffness()
    assert rubbing.true_critical_stiffness() == pytest.approx(limit, rel=1e-12)
    assert not run_wall(bench, 1.3 * limit, seconds=3.0, push=0.05).stable
    assert run_wall(rubbing, 1.3 * limit, seconds=3.0, push=0.05).stable
    assert not run_wall(rubbing, 1.3 * limit, seconds=3.0, push=20.0).stable


def test_a_new_effect_is_one_small_class() -> None:
    @register
    @dataclass(frozen=True)
    class Brake(Effect):
        name: ClassVar[str] = "test_brake"
        damping: float = 5.0

        def build(self, structure: Structure) -> None:
            structure.links.append(Link("m1", FRAME, 0.0, self.damping))

        def parameters(self, values: Mapping[str, float], progress: float) -> Mapping[str, float]:
            return values

    try:
        braked = BLOCK.with_effect("test_brake", damping=8.0)
        same = replace(BLOCK, values={"m": 2.0, "b": 8.0})
        force = np.random.default_rng(0).normal(size=1000)
        np.testing.assert_array_equal(
            simulate(braked, force).position, simulate(same, force).position
        )
    finally:
        del REGISTRY["test_brake"]


@pytest.mark.parametrize(
    "effects",
    [
        ("coulomb_friction",),
        ("stribeck_friction", "reflex"),
        ("dahl_friction", "backlash", "force_ripple"),
        ("drag", "hardening_spring", "extra_delay"),
    ],
    ids=lambda effects: " ".join(effects),
)
def test_compiled_steps_are_the_plain_ones(effects: tuple[str, ...]) -> None:
    bench = HELD
    for effect in effects:
        bench = bench.with_effect(effect)
    rng = np.random.default_rng(2)
    acting, hand = 4.0 * rng.normal(size=151), 0.1 * rng.normal(size=151)
    found = []
    for run in (plainly, Stepper.run):
        stepper = Stepper(bench.plant(), PERIOD)
        stepper.start(np.zeros(stepper.plant.states))
        halves = [(acting[:76], hand[:76]), (acting[75:], hand[75:])]
        found.append(np.concatenate([run(stepper, *half) for half in halves]))
    size = np.abs(found[0]).max(axis=0)
    assert np.all(np.abs(found[1] - found[0]) <= 1e-11 * size)
    assert np.all(size[: 2 * len(bench.plant().places)] > 0)
