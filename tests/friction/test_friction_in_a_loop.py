"""Friction of a device that nobody holds, and that rests for much of a loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from benchmarks.through_reference import make


@pytest.mark.parametrize("seed", [4011, 4041])  # LHIfAMs that follow ramps, and rest half the time
def test_the_mean_of_the_command_acts_as_the_rest_of_it_does(seed: int) -> None:
    """A step of an eighth of a period puts a slide's end wrong by up to some counts.

    From the command without its mean the motion was off by 114 and 17 counts.
    """
    case = make(seed)
    etfe = estimate_by_direct_method(replace(case.recording, reference=None))
    fit = least_squares(build_model("free", "lhifam", delay_s=case.bench.delay_s), etfe)
    assert etfe.unbroken is not None
    simulation = Tryout(State(etfe, fit), etfe.unbroken).simulation
    truth = {**case.bench.values, "delay_s": case.bench.delay_s}
    theta = np.array([truth[name] for name in fit.model.names])
    friction = (Acting(CoulombFriction(MOTOR), case.friction * case.bench.force_rms),)
    besides, left, _ = simulation._with(friction, theta)
    rest = left - simulation.added(friction, theta).sum(axis=0)
    assert np.std(rest - besides.of(rest)) < 4 * case.bench.encoder_resolution
