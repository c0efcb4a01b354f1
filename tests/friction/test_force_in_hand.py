"""Friction of a device that somebody holds, fitted to a loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from benchmarks.through_reference import make

SEED, SAMPLES = 4019, 6000  # a LHIfAM that follows noise under a PD controller


def test_friction_in_a_hand_is_found_in_a_loop() -> None:
    """From six tenths of it: fits went no further, whose slopes took what slides for history."""
    case = make(SEED)
    force, position = case.recording.force[:SAMPLES], case.recording.position[:SAMPLES]
    etfe = estimate_by_direct_method(
        replace(case.recording, force=force, position=position, reference=None)
    )
    fit = least_squares(build_model("grasped", "lhifam", delay_s=case.bench.delay_s), etfe)
    assert etfe.unbroken is not None
    tryout = Tryout(State(etfe, fit), etfe.unbroken)
    strength = case.friction * case.bench.force_rms
    truth = {**case.bench.values, "delay_s": case.bench.delay_s}
    theta = np.array([truth[name] for name in fit.model.names])
    start = tryout.point((Acting(CoulombFriction(MOTOR), 0.6 * strength),), fit.theta)
    found = fit_force(tryout, start)
    assert found.gain_fit > tryout.as_it_is((Acting(found.effect, strength),), theta).gain_fit
    assert found.strength == pytest.approx(strength, rel=0.1)
