"""What the error of a law leaves open of the limit, beside fits with more and less of the force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from on_the_bench import recorded_on

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.diagnosis.trials.forces.trial import in_doubt
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise
from bayeshaptic.rig.effects.nonlinear import Drag
from bayeshaptic.stability import critical_stiffness

LHIFAM = Bench.from_device("lhifam")


def state_of(bench: Bench) -> State:
    """A free device fitted to ten seconds of white noise."""
    recording = recorded_on(bench, WhiteNoise(4.0, 300.0, 0.3, 10.0), seed=3)
    etfe = estimate_etfe(recording)
    return State(etfe, least_squares(build_model("free", "lhifam"), etfe))


def beside(tryout: Tryout, point: Point, factor: float) -> Point:
    """The linear parameters fitted beside so much of the force, in the motion that it makes."""
    forces = (Acting(point.effect, factor * point.strength),)
    found = tryout.point(forces, point.theta, expected=point.motion)
    for _ in range(20):
        further = tryout.point(forces, found.theta, expected=found.motion)
        if np.allclose(further.theta, found.theta, rtol=1e-4):
            break
        found = further
    return found


@pytest.mark.parametrize(("share", "friction"), [(1.0, 0.3), (1.0, 0.6), (0.1, 0.8), (0.1, 1.2)])
def test_a_law_moves_the_limit_as_far_as_more_of_the_force_does(
    share: float, friction: float
) -> None:
    """The force itself is known far better here, so that the spread is its law's.

    With a share of the damping, friction is nearly all of it: slopes at the fit say 0.29 and 0.19
    of log K_CR there, and fits with less and with more of the force 0.45 and 0.93, 0.62 and 1.5.
    These two differ by their own size, and leave more than noise: hence half as much either way.
    """
    damping = {name: share * LHIFAM.values[name] for name in ("b1", "b2")}
    device = replace(LHIFAM, values={**LHIFAM.values, **damping})
    state = state_of(device.with_effect("coulomb_friction", force=friction))
    assert state.etfe.recording is not None
    tryout = Tryout(state, state.etfe.recording)
    start = tryout.point((Acting(CoulombFriction(MOTOR), friction),), state.fit.theta)
    point = fit_force(tryout, start)
    moved = [
        abs(log_limit(beside(tryout, point, factor)) - log_limit(point))
        for factor in (1 - thresholds.LAW_SD, 1 + thresholds.LAW_SD)
    ]
    assert min(moved) / 1.5 < in_doubt(tryout, point)[1] < 1.5 * max(moved)


def log_limit(point: Point) -> float:
    model = build_model("free", "lhifam")
    return float(np.log(critical_stiffness(model, point.theta).value))


def test_drag_at_the_load_is_seen_over_its_velocity() -> None:
    """The load of a free device moves as its motor does when it is slow, and otherwise alone."""
    state = state_of(LHIFAM.with_effect(Drag(200.0, "m2")))
    tests = {test.name: test for test in nonlinear_tests(state.fit, state.etfe)}
    assert tests["v2|v2|"].flagged
    names = ("v|v|", "sign(v2)", "v2^3")
    assert all(tests["v2|v2|"].statistic > tests[name].statistic for name in names)
    assert tests["v2|v2|"].force is not None and tests["v2|v2|"].force.strength > 0
