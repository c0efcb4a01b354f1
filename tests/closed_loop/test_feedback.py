"""Closing the loop on recordings with feedback: by the force, not by the biased response."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_analysis import FEEDBACK, fake_closed
from one_truth import check_page, text_of
from test_measured import PERIOD_S, servo

import bayeshaptic as bh
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.feedback.explain import ForceExplained, explain_force
from bayeshaptic.recordings import recording_from_arrays, through_reference
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.figures.loop import inverse
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop import force_words, words
from bayeshaptic.rig import Bench, run_loop
from bayeshaptic.types import Floats

FRICTION_N = 20.0


@pytest.fixture(scope="module")
def closed() -> Closed:
    return bh.close_loop(servo(FRICTION_N), "rigid", delay_s=0.0, ess=300)


def test_the_friction_of_a_servo_is_found_in_its_force(closed: Closed) -> None:
    assert has_feedback(closed.base.notices) and closed.force is not None
    assert pickle.loads(pickle.dumps(closed)).force is not None  # as workers hand it back
    (friction,) = closed.effects
    assert friction.name == "coulomb_friction" and friction.family == "nonlinear"
    found = closed.analysis.posterior.summary()["coulomb"]
    # Four of its own standard deviations, or one per cent (friction is not quite a step in time).
    assert abs(found["mean"] - FRICTION_N) < max(4 * found["sd"], 0.01 * FRICTION_N)
    assert found["unit"] == "N"
    linear, first, *_ = closed.force.further.steps
    assert first.term == "coulomb" and first.held_out_rms < 0.3 * linear.held_out_rms


def test_the_response_is_not_mended_with_what_the_controller_did(closed: Closed) -> None:
    assert closed.analysis.etfe is closed.base.etfe
    assert closed.traced.candidates == () and closed.before.keys() == closed.after.keys()


def test_the_report_tells_of_the_force_and_of_the_motion(closed: Closed, tmp_path: Path) -> None:
    page = text_of(bh.write_report(closed, tmp_path / "out"))
    check_page(closed, tmp_path / "out")
    assert "The motion, simulated in the same loop" in page and "feedback biases it" in page
    assert "The force, explained by the motion" in page and "What the model lacked" not in page
    assert "With dry (Coulomb) friction beside it" in page
    names = {path.name for path in (tmp_path / "out").glob("loop_*.png")}
    assert names == {"loop_inverse.png"}
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["recording"]["feedback"] is True
    (effect,) = summary["diagnosis"]["effects"]
    assert effect["parameters"]["coulomb"]["q05"] < FRICTION_N * 1.01
    assert summary["critical_stiffness"]["etfe"] == {"q05": None, "q50": None, "q95": None}


def test_an_older_report_does_not_leave_its_figure(closed: Closed, tmp_path: Path) -> None:
    bh.write_report(closed, tmp_path)
    bh.write_report(fake_closed("explained", "nonlinear"), tmp_path)
    assert not (tmp_path / "loop_inverse.png").exists()


def test_a_servo_without_friction_gets_none() -> None:
    force = explain_force(servo(0.0))
    assert force is not None
    assert "coulomb" not in [term.name for term in force.further.terms]
    mass, sd = force.first["mass"]
    assert abs(mass - 90.0) < max(4 * sd, 0.9)
    said = force_words.in_short(force, "N") + force_words.found(force, "N", "")
    assert "friction" not in said


def test_equations_that_are_alike_are_shown_once(closed: Closed) -> None:
    force = closed.force
    assert force is not None
    for count, heads in ((1, ("", "estimate")), (2, ("", "with the term added"))):
        further = replace(force.further, steps=force.further.steps[:count])
        told = ForceExplained(further if count == 1 else force.first, further)
        assert force_words.coefficient_heads(told) == heads
        assert {len(row) for row in force_words.coefficients(told)} == {2}
        assert "first term" not in force_words.remains(told, closed.analysis)
        figure = inverse.draw(replace(closed, force=told))
        assert len(figure.axes[0].get_legend().get_texts()) == count
    several = replace(force.further, steps=force.further.steps[:1] * 3)
    assert len(force_words.fits(ForceExplained(force.first, several))) == 2


def test_what_does_not_move_as_one_mass_or_is_too_short_is_left_to_the_response() -> None:
    recording = servo(FRICTION_N)
    # The force of another instant says nothing of this motion.
    other = recording_from_arrays(recording.force[::-1], recording.position, period_s=PERIOD_S)
    assert explain_force(other) is None
    short = recording_from_arrays(
        recording.force[:900], recording.position[:900], period_s=PERIOD_S
    )
    assert explain_force(short) is None and explain_force(None) is None


def test_feedback_without_a_force_leaves_the_loop_as_it_was(tmp_path: Path) -> None:
    closed = fake_closed("explained", "nonlinear", notices=(FEEDBACK,))
    page = text_of(bh.write_report(closed, tmp_path))
    assert "What the model lacked" in page and "explained by the motion" not in page


def two_masses(wanted: Floats, added: Floats | float = 0.0) -> tuple[Recording, Bench]:
    """Under a PD controller that follows `wanted`, which is not written down."""
    bench, last = Bench.from_device("lhifam", False, "free"), [0.0]
    more = np.broadcast_to(added, wanted.shape)

    def controller(k: int, position: float) -> float:
        rate, last[0] = (position - last[0]) * 1000 if k else 0.0, position
        return float(3000.0 * (wanted[k] - position) - 60.0 * rate + more[k])

    done = run_loop(bench, controller, len(wanted) * bench.period_s)
    return recording_from_arrays(**done.signals), bench


def test_steps_of_two_masses_under_a_controller_say_their_limit() -> None:
    goals = np.random.default_rng(2).uniform(-1e-3, 1e-3, 20)
    recording, bench = two_masses(np.repeat(goals, 150))
    closed = bh.close_loop(recording, "free", ess=300, hidden=False)
    assert headline(closed).status == "safe" and closed.verdict == "consistent"
    low, high = (closed.analysis.limit.quantile(p) for p in (0.005, 0.995))
    assert low < bench.true_critical_stiffness() < high < 1.5 * low


def test_two_masses_under_a_controller_are_refused_before_sampling(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As if nothing of the command were new: through what was added to it their limit is seen."""
    rng = np.random.default_rng(2)
    goals = np.repeat(rng.uniform(-1e-3, 1e-3, 20), 150)
    recording, _ = two_masses(goals, 0.3 * rng.standard_normal(3000))  # no law is exact
    monkeypatch.setattr(through_reference, "command_innovations", lambda recording: None)
    # In a band, where the lines do not add up to nothing.
    closed = bh.close_loop(recording, "free", ess=100, band_hz=(1.0, 300.0))
    assert closed.force is None and closed.effects == () and closed.traced.candidates == ()
    head = headline(closed)
    assert head.status == "untrusted" and "was computed from the motion" in head.sentence
    assert "Nothing was looked for in the response" in words.in_short(closed)
    assert not closed.analysis.sampled
    page = text_of(bh.write_report(closed, tmp_path))
    check_page(closed, tmp_path)
    assert "None is stated" in page and "bayeshaptic report NEW.csv" in page
    assert not (tmp_path / "posterior.nc").exists()


def coarse(resolution: float, seconds: float = 12.0) -> Recording:
    """One mass under a PD controller that follows ramps, read in counts."""
    bench = Bench("rigid", {"m": 0.5, "b": 1.0}, delay_s=5e-4, encoder_resolution=resolution)
    rng, count = np.random.default_rng(2), round(seconds / bench.period_s)
    corners = np.arange(0, count + 700, 700)
    target = np.interp(np.arange(count), corners, rng.uniform(-0.02, 0.02, len(corners)))
    last, omega = [0.0], 2 * np.pi * 2.0

    def control(k: int, position: float) -> float:
        rate, last[0] = (position - last[0]) / bench.period_s if k else 0.0, position
        return float(0.5 * omega**2 * (target[k] - position) - 0.7 * omega * rate)

    made = run_loop(bench, control, seconds, seed=1)
    return recording_from_arrays(made.force, made.position, bench.period_s)


@pytest.mark.parametrize("resolution", [1e-7, 5e-5])
def test_one_mass_is_known_as_such_whatever_its_counts_are(resolution: float) -> None:
    """In a twentieth of the sampling rate the acceleration was noise, and 4 of 20 were refused."""
    recording = coarse(resolution)
    found = explain_force(recording)
    assert found is not None
    assert found.further.relative_error < 0.2
    assert found.further["mass"][0] == pytest.approx(0.5, rel=0.05)
    usual = 0.05 / recording.period_s
    assert (found.further.cutoff_hz == usual) == (resolution < 1e-6)
