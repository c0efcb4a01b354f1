"""What a force adds and the motion that nothing known makes are found together."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from on_the_bench import recorded_on

from bayeshaptic.diagnosis.trials.forces.besides import settled
from bayeshaptic.diagnosis.trials.forces.simulation import Simulation
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.models.response.motion import linear_motion
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise
from bayeshaptic.types import Floats

FRICTION = 1.2
LIGHTLY_DAMPED = {"b1": 0.02, "b2": 0.05}  # friction is nearly all of the damping


@cache
def simulated(held: bool) -> tuple[Simulation, Floats, float]:
    """A device that rubs, its true parameters and its encoder's count."""
    device = Bench.from_device("lhifam", held=held)
    device = replace(device, values={**device.values, **LIGHTLY_DAMPED})
    bench = device.with_effect("coulomb_friction", force=FRICTION)
    recording = recorded_on(bench, WhiteNoise(4.0, 300.0, 0.3, 10.0), seed=3)
    model = build_model("grasped" if held else "free", "lhifam")
    usual = least_squares(model, estimate_etfe(recording))
    truth = {**bench.values, "delay_s": bench.delay_s}
    theta = np.array([truth[name] for name in usual.model.names])
    nothing = np.zeros(recording.samples)
    return (
        Simulation(usual.model, recording, usual.theta, nothing),
        theta,
        bench.encoder_resolution,
    )


@pytest.mark.parametrize(("held", "counts"), [(False, 8.0), (True, 0.6)])
def test_friction_that_is_nearly_all_damping_leaves_little(held: bool, counts: float) -> None:
    """97 and 0.8 of the encoder's counts beside the first guess of coasting and hand."""
    simulation, theta, count = simulated(held)
    recording = simulation.recording
    friction = (Acting(CoulombFriction(MOTOR), FRICTION),)
    system = simulation.model.system(theta)
    by_itself = linear_motion(system, simulation.arriving(()), recording.period_s)[0]
    left = recording.position - by_itself - simulation.added(friction, theta).sum(axis=0)
    besides = simulation._besides(theta, (MOTOR,))
    assert np.std(left - besides.of(left)) < counts * count


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("factor", [0.3, 0.6, 1.3])
def test_forces_that_are_not_those_that_acted_settle_too(held: bool, factor: float) -> None:
    """Steps as large as the true friction asks for led away, for ever."""
    simulation, theta, _ = simulated(held)
    friction = (Acting(CoulombFriction(MOTOR), factor * FRICTION),)
    besides, left, forced = simulation._with(friction, theta)
    first = besides.of(left) if held else np.zeros_like(left)  # a poor start
    found = settled(besides, left, forced, first).sum(axis=0)

    def off(added: Floats) -> float:
        taken = besides.of(left - added)
        return float(np.std(besides.off(taken, left - forced(taken).sum(axis=0) - taken)))

    assert off(found) < 0.3 * off(forced(first).sum(axis=0))


def test_what_a_force_adds_is_known_to_first_order_from_another_near_by() -> None:
    """With the coasting that goes with friction of a fiftieth more; or it is off by all of that."""
    simulation, theta, _ = simulated(held=False)
    now, then = ((Acting(CoulombFriction(MOTOR), factor * FRICTION),) for factor in (1.0, 1.02))
    added = simulation.added(now, theta)
    here = simulation.added_near(now, theta, added)
    whole = simulation.added(then, theta, added.sum(axis=0)) - added
    assert np.std(simulation.added_near(then, theta, added) - here - whole) < 0.3 * np.std(whole)
