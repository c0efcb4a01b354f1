"""A hand moves a device the less the more forces hold it back: the density of what was measured."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from on_the_bench import recorded_on, usual_noise
from scipy.signal import butter, csd, sosfiltfilt, welch

from bayeshaptic.diagnosis.state import State, log_likelihoods
from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.diagnosis.trials.forces.simulation import Simulation
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout, answered
from bayeshaptic.effects.nonlinear.actuator import ActuatorSaturation
from bayeshaptic.effects.nonlinear.drag import Drag
from bayeshaptic.effects.nonlinear.friction import CoulombFriction, StribeckFriction
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.effects.nonlinear.springs import HardeningSpring
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import build_model
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench
from bayeshaptic.types import Floats

FORCES = ("coulomb_friction", "drag")


def recorded(held: bool, seconds: float = 20.0) -> tuple[Bench, Recording]:
    bench = Bench.from_device("phantom", held=held)
    for effect in FORCES:
        bench = bench.with_effect(effect)
    return bench, recorded_on(bench, usual_noise(bench, seconds), seed=4)


@pytest.fixture(scope="module")
def held() -> tuple[Bench, Tryout, Floats]:
    """A held device with friction and a drag, tried on, and its true parameters."""
    bench, recording = recorded(held=True)
    model = build_model("grasped", delay_s=bench.delay_s, period_s=recording.period_s)
    etfe = estimate_etfe(recording)
    fit = least_squares(model, etfe)
    theta = np.array([max(bench.values[name], 1e-6) for name in fit.model.names])
    return bench, Tryout(State(etfe, fit), recording), theta


def acting(bench: Bench) -> tuple[Acting, Acting]:
    rubs, drags = bench.effects
    return Acting(Drag(MOTOR), drags.coefficient), Acting(CoulombFriction(MOTOR), rubs.force)


def test_what_forces_take_of_a_hands_motion_is_what_is_simulated(held) -> None:  # type: ignore[no-untyped-def]
    """A little more of a hand's motion in the recording, and how much more is left of it."""
    rig, bench, theta = held
    simulation: Simulation = bench.simulation
    recording, forces = simulation.recording, acting(rig)
    period = recording.period_s
    low = butter(4, (2.0, 12.0), "band", fs=1 / period, output="sos")
    more = sosfiltfilt(low, np.random.default_rng(1).standard_normal(recording.samples))
    more *= 0.1 * np.std(sosfiltfilt(low, recording.position)) / np.std(more)
    moved = replace(recording, position=recording.position + more)

    def left(of: Recording) -> Floats:
        found = replace(simulation, recording=of)
        return np.asarray(of.position - found.added(forces, theta).sum(axis=0))

    further = left(moved) - left(recording)
    frequency_hz, across = csd(more, further, fs=1 / period, nperseg=2048)
    seen = np.abs(across / welch(more, fs=1 / period, nperseg=2048)[1])
    inside = (frequency_hz > 3) & (frequency_hz < 10)
    told = bench.answer(theta).louder(
        answered(bench.as_it_is(forces, theta).changes), frequency_hz[inside]
    )
    assert 1.1 < np.median(told) < 2
    # On the average over the motion, which is noise: to a tenth of what the forces do.
    assert np.median(seen[inside] / told) == pytest.approx(1, abs=0.1 * (np.median(told) - 1))


def test_its_slope_is_that_of_two_near_by(held) -> None:  # type: ignore[no-untyped-def]
    rig, bench, theta = held
    added = answered(bench.as_it_is(acting(rig), theta).changes)
    answer, step = bench.answer(theta), 1e-6
    more = np.random.default_rng(2).standard_normal() * added
    found = answer.growth(added, np.array([more]))[0]
    near = [
        answer.louder(added + side * step * more, bench.at_lines.frequency_hz) for side in (1, -1)
    ]
    np.testing.assert_allclose(found, np.log(near[0] / near[1]) / (2 * step), atol=1e-6)


def test_nothing_is_louder_without_a_hand_or_forces_on_it(held) -> None:  # type: ignore[no-untyped-def]
    rig, bench, theta = held
    between = (Acting(HardeningSpring(CONNECTION), 1.0), Acting(ActuatorSaturation(), 1.0))
    changes = bench.changes(between, np.zeros((2, bench.recording.samples)))
    assert bench.without(changes, theta).spectra.louder is None
    assert bench.as_it_is(acting(rig), theta).windows.louder is not None
    free, recording = recorded(held=False, seconds=5.0)
    model = build_model("free", delay_s=free.delay_s, period_s=recording.period_s)
    etfe = estimate_etfe(recording)
    other = Tryout(State(etfe, least_squares(model, etfe)), recording)
    assert other.as_it_is(acting(free), other.state.fit.theta).windows.louder is None


def test_what_no_force_answers_to_makes_nothing_louder(held) -> None:  # type: ignore[no-untyped-def]
    """A hand that is softer goes further, and is no likelier for that: forces are what counts."""
    rig, bench, theta = held
    faint = tuple(replace(one, strength=1e-4 * one.strength) for one in acting(rig))
    softer = theta * np.where(np.isin(bench.model.names, ("kh", "bh")), 0.5, 1.0)
    for vector in (theta, softer):
        assert np.allclose(bench.as_it_is(faint, vector).windows.louder, 1, atol=1e-3)


def test_every_likelihood_has_the_same_part_of_it(held) -> None:  # type: ignore[no-untyped-def]
    rig, bench, theta = held
    windows = bench.as_it_is(acting(rig), theta).windows
    plain = replace(windows, louder=None)
    whole, part = np.sum(windows.offset), np.arange(len(windows.lines)) % 4 == 1
    assert whole > 10
    both = [Likelihood(bench.model, one) for one in (windows, plain)]
    same, other = (one(theta[None])[0] for one in both)
    assert same - other == pytest.approx(whole)
    same, other = (one.pointwise(theta[None]).sum() for one in both)
    assert same - other == pytest.approx(whole)
    kept = Likelihood(bench.model, windows.part(part))(theta[None])[0]
    assert kept == pytest.approx(both[0].pointwise(theta[None])[0, part].sum())
    judged = [log_likelihoods(bench.model, one, theta)[1] for one in (windows, plain)]
    assert judged[0] - judged[1] == pytest.approx(np.asarray(windows.offset)[part].sum())


def test_forces_that_stand_in_are_no_likelier_than_those_that_act(held) -> None:  # type: ignore[no-untyped-def]
    """Weaker forces beside a larger damper leave less of a hand's motion, and seemed likelier.

    By 50 on the windows to fit, of 30 s, with a limit 3.4 dB too high.
    """
    rig, bench, theta = held
    there = bench.point(acting(rig), theta, rounds=2)
    drags, rubs = acting(rig)
    falls = StribeckFriction(MOTOR, {"static_excess": 2.0, "stribeck_velocity": 0.236})
    weaker = (Acting(drags.effect, 0.54 * drags.strength), Acting(falls, 0.3 * rubs.strength))
    instead = fit_force(bench, bench.point(weaker, theta, rounds=2))
    # Two numbers more that are fitted are worth 1 by chance, and 6 once in 400 times.
    assert instead.gain_fit < there.gain_fit + 6
    assert instead.gain_choose < there.gain_choose + 6
