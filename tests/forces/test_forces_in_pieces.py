"""Forces in several recordings that count as one: one law, and each piece moves by itself."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from on_the_bench import usual_noise

import bayeshaptic as bh
from bayeshaptic.diagnosis.residuals.pieces import force_in_pieces
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.diagnosis.trials.forces import called_for as tried
from bayeshaptic.diagnosis.trials.forces.in_pieces import (
    SimulationInPieces,
    simulated_in,
    simulation_in,
)
from bayeshaptic.diagnosis.trials.forces.simulation import Simulation
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.diagnosis.trials.taken_off import put_back
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.checks.unlike_pieces import named_unlike, still_unlike, unlike_pieces
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, simulate
from bayeshaptic.stability import critical_stiffness

BENCH = Bench.from_device("lhifam", False, "free")
FRICTION = 0.1 * BENCH.force_rms


@cache
def rubbed() -> State:
    """White noise on a free LHIfAM that rubs, in three pieces."""
    bench = BENCH.with_effect("coulomb_friction", force=FRICTION)
    made = [simulate(bench, usual_noise(bench, 4.0), seed=seed) for seed in range(3)]
    joined = bh.join_recordings([bh.recording_from_arrays(**one.signals) for one in made])
    etfe = estimate_etfe(joined)
    return State(etfe, least_squares(build_model("free", "lhifam"), etfe))


@cache
def found() -> Trial:
    (trial,) = nonlinear_trials(rubbed(), {"sign(v)"}, Meter(1e9))
    return trial


@pytest.fixture(autouse=True)
def only_coulomb(monkeypatch: pytest.MonkeyPatch) -> None:
    kinds = [kind for kind in effects("nonlinear") if kind.name == "coulomb_friction"]
    monkeypatch.setattr(tried, "effects", lambda family: kinds)


def test_friction_of_all_pieces_is_one_and_is_taken_off() -> None:
    """It was left in them, and no stiffness followed from any series that rubs."""
    trial = found()
    assert trial.convincing
    estimate = trial.accepted.estimates["friction_force"]
    assert abs(estimate.mean - FRICTION) < 3 * estimate.sd
    assert estimate.mean == pytest.approx(FRICTION, rel=0.05)
    truth = critical_stiffness(build_model("free", "lhifam")).value
    before, after = (
        critical_stiffness(s.model, s.fit.theta[None]) for s in (rubbed(), trial.state)
    )
    assert before.samples[0] > 1.2 * truth
    assert after.samples[0] == pytest.approx(truth, rel=0.03)
    (left,) = (t for t in force_in_pieces(trial.state.fit, trial.state.etfe) if t.name == "sign(v)")
    assert not left.flagged


def test_what_was_taken_off_pieces_can_be_put_back() -> None:
    trial, etfe = found(), rubbed().etfe
    assert trial.accepted.change
    back = put_back(trial.state.etfe, trial.accepted.change, ())
    for one, other in zip((back, *back.parts), (etfe, *etfe.parts), strict=True):
        assert one.recording and other.recording
        np.testing.assert_allclose(one.recording.position, other.recording.position, atol=1e-12)
    windows = (one.spectra.windows(rubbed().fit.response) for one in (back, etfe))
    np.testing.assert_allclose(*(own.target for own in windows), rtol=1e-6, atol=1e-12)


def test_each_piece_moves_by_itself() -> None:
    """As it would if it had been recorded alone; pieces that do not count do not move."""
    state = rubbed()
    recording, model = state.etfe.recording, state.model
    assert recording is not None
    etfe = replace(state.etfe, parts=state.etfe.parts[::2])
    nothing = np.zeros(recording.samples)
    whole = simulation_in(replace(state, etfe=etfe), recording, state.fit.theta, nothing)
    assert isinstance(whole, SimulationInPieces)
    forces = (Acting(CoulombFriction(MOTOR), FRICTION),)
    added = whole.added(forces, state.fit.theta)
    assert not added[:, recording.spans[1]].any()
    for span, piece in ((recording.spans[n], recording.pieces[n]) for n in (0, 2)):
        alone = Simulation(model, piece, state.fit.theta, nothing[span])
        np.testing.assert_array_equal(added[:, span], alone.added(forces, state.fit.theta))


def test_not_where_somebody_holds_them_nor_of_an_actuator(monkeypatch: pytest.MonkeyPatch) -> None:
    """A hand's own motion is read off one piece; how a limit goes with the speed, too."""
    state = rubbed()
    assert simulated_in(state) is not None
    held = least_squares(build_model("grasped", "lhifam"), state.etfe)
    assert simulated_in(replace(state, fit=held)) is None
    kinds = [kind for kind in effects("nonlinear") if kind.name == "actuator_saturation"]
    monkeypatch.setattr(tried, "effects", lambda family: kinds)
    recording = state.etfe.recording
    assert recording is not None
    simulation = simulation_in(state, recording, state.fit.theta, np.zeros(recording.samples))
    motion = simulation.motions(state.fit.theta, (MOTOR,))
    one_piece = replace(state, etfe=state.etfe.parts[0])
    assert tried.called_for(one_piece, {"command"}, motion)[0]
    assert tried.called_for(state, {"command"}, motion) == ([], [])


def test_pieces_of_several_levels_are_alike_without_their_friction() -> None:
    """They were said to be of several devices, and no stiffness followed."""
    bench = BENCH.with_effect("coulomb_friction", force=0.3 * BENCH.force_rms)
    made = []
    for level, seed in ((0.6, 1), (3.0, 2)):
        noise = usual_noise(replace(bench, force_rms=level * bench.force_rms), 4.0)
        made.append(bh.recording_from_arrays(**simulate(bench, noise, seed=seed).signals))
    etfe = estimate_etfe(bh.join_recordings(made))
    told = unlike_pieces(etfe)
    assert named_unlike(told)
    assert still_unlike(told, etfe) == told  # nothing was taken off
    state = State(etfe, least_squares(build_model("free", "lhifam"), etfe))
    trial = max(nonlinear_trials(state, {"sign(v)"}, Meter(1e9)), key=lambda one: one.score)
    assert named_unlike(still_unlike(told, trial.state.etfe)) == ()
