"""What friction does while it holds a device in a hand, told from how smoothly hands move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_bench import PHANTOM_HELD, Device

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.at_rest import at_rest
from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from bayeshaptic.types import Floats
from benchmarks.through_reference import make

PERIOD_S, COUNT, EDGE_HZ = 1e-3, 6e-5, 30.0
SAMPLES, FIRST, STOP = 5000, 2000, 2600  # it rests in between


def moved_but(stop: int) -> tuple[Recording, Floats]:
    """A device that goes to and fro but for a rest from FIRST to `stop`, and its instants."""
    time = PERIOD_S * np.arange(SAMPLES)
    position = 0.02 * np.sin(2 * np.pi * 8.0 * time)
    position[FIRST:stop] = position[FIRST]
    position = np.round(position / COUNT) * COUNT
    recording = recording_from_arrays(
        np.zeros(SAMPLES), position, period_s=PERIOD_S, force_unit="Nm", position_unit="rad"
    )
    return recording, time


def test_what_a_force_does_at_rest_is_told_from_a_smooth_hand() -> None:
    recording, time = moved_but(STOP)
    hand = 0.01 * np.sin(2 * np.pi * 0.4 * time) + 0.003 * np.cos(2 * np.pi * 0.9 * time)
    force = np.zeros(SAMPLES)
    inside = np.arange(STOP - FIRST) / (STOP - FIRST)
    force[FIRST:STOP] = 0.02 * (1 + inside)  # begins and ends at once
    added = Device(PHANTOM_HELD, delay=0.0).simulate(force)
    model = build_model("grasped", "phantom")
    rests = at_rest(recording, model.system(model.values), EDGE_HZ)
    assert rests is not None
    found = rests.smoothest(hand + added)
    # A level that lasts for 0.6 s is told by how it begins and ends alone, of which the ridge takes
    # a part: not all of it is found, but ten times more than is left.
    assert np.std(found - hand) < 0.1 * np.std(added)


def test_who_keeps_moving_has_no_rest() -> None:
    recording, _ = moved_but(FIRST)
    model = build_model("grasped", "phantom")
    assert at_rest(recording, model.system(model.values), EDGE_HZ) is None


def test_friction_that_holds_a_held_device_is_not_taken_for_less() -> None:
    """A PHANToM that follows steps and rests for a quarter: fits ended at 0.87 of its friction."""
    case = make(153)
    etfe = estimate_by_direct_method(replace(case.recording, reference=None))
    fit = least_squares(build_model("grasped", "phantom", delay_s=case.bench.delay_s), etfe)
    assert etfe.unbroken is not None
    tryout = Tryout(State(etfe, fit), etfe.unbroken)
    strength = case.friction * case.bench.force_rms
    start = tryout.point((Acting(CoulombFriction(MOTOR), 0.6 * strength),), fit.theta)
    assert fit_force(tryout, start).strength == pytest.approx(strength, rel=0.05)
