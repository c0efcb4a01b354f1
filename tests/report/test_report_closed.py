"""The report of a closed loop: what it says for each verdict, its figures, its files."""

from __future__ import annotations

import html
import json
import re
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from browser import needs_browser, probe
from fake_analysis import FakeAnalysis, fake_analysis, fake_closed

from bayeshaptic import read_recording, write_report
from bayeshaptic.diagnosis.residuals.columns import motions
from bayeshaptic.diagnosis.residuals.force_curve import force_curve
from bayeshaptic.diagnosis.residuals.ripples import WAVES
from bayeshaptic.diagnosis.residuals.supply import SPEED
from bayeshaptic.diagnosis.state import Accepted
from bayeshaptic.diagnosis.traced import Candidate
from bayeshaptic.effects.library import effect_class
from bayeshaptic.inference.fit import summarise
from bayeshaptic.models import build_model
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.report import summary
from bayeshaptic.report.assumptions import assumptions
from bayeshaptic.report.figures.loop import stiffness as loop_stiffness
from bayeshaptic.report.figures.pictures import LOOP_PICTURES
from bayeshaptic.report.figures.response import draw as draw_response
from bayeshaptic.report.headline import headline
from bayeshaptic.report.listed import listed
from bayeshaptic.report.loop.tables import (
    candidates,
    error_heads,
    errors,
    estimates,
    found,
    outcomes,
)
from bayeshaptic.report.loop.words import in_short, lacked, subject, verdict
from bayeshaptic.report.words import widened

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
FAMILIES = ("linear", "nonlinear", "time-varying")
LOOP_FILES = {f"{picture.name}.png" for picture in LOOP_PICTURES}


# ---- words


def test_what_was_lacking_in_one_sentence() -> None:
    text = lacked(fake_closed())
    assert "lacked dry (Coulomb) friction at the motor (friction force 0.593 ± 0.020 N)" in text
    assert "adding it (1 parameter) cut the held-out error from 1.60 to 1.02 times" in text
    # 1.66 is 4.4 dB.
    assert re.search(r"K_CR moved from 3\d\.\d+ to 2\d\.\d+ kN/m \(−4\.4 dB\)", text), text


def test_errors_before_and_after_are_beside_one_measurement() -> None:
    closed = fake_closed()
    assert error_heads(closed) == ("", "before", "after")
    alike = {**closed.before, "weighted_rms": 7.0, "held_out_weighted_rms": 8.0}
    closed = replace(closed, before_like_after=alike)
    heads, rows = error_heads(closed), errors(closed)
    assert heads == ("", "before, as measured", "before, corrected", "after, corrected")
    assert {len(row) for row in rows} == {4}
    assert rows[0][1:] == ("1.60", "7.00", "1.02")
    assert "cut the held-out error from 8.00 to 1.02 times" in lacked(closed)
    changing = replace(fake_closed(family="time-varying"), before_like_after=alike)
    assert error_heads(changing)[1:] == (
        "before, whole recording",
        "before, worst part",
        "after, worst part",
    )


def test_a_response_with_a_force_taken_off_is_not_called_as_measured() -> None:
    closed = fake_closed(misfit=13.0)
    closed = replace(closed, analysis=closed.analysis)
    closed.analysis.etfe = replace(closed.analysis.etfe)  # another one than before
    (said,) = (text for text in headline(closed).details if "puts the limit at" in text)
    assert "after dry (Coulomb) friction at the motor was taken off it" in said
    assert "without a model" not in said
    labels = draw_response(closed).axes[0].get_legend_handles_labels()[1]
    assert "as measured" in labels and "measured, corrected, ± 2 sd" in labels
    assert "measured, ± 2 sd" not in labels
    bare = headline(fake_analysis("grasped", misfit=13.0))
    assert any("itself, without a model, puts the limit at" in text for text in bare.details)


def test_several_effects_are_one_sentence() -> None:
    assert listed([]) == "" and listed(["a"]) == "a" and listed(["a", "b"]) == "a and b"
    assert listed(["a", "b", "a", "b", "b"]) == "a (twice) and b (three times)"
    closed = fake_closed()
    (one,) = closed.effects
    titles = ("cogging: a force that ripples along the way", "compliant base", "gravity")
    state = closed.traced.state
    several = tuple(replace(one, title=title) for title in titles)
    traced = replace(closed.traced, state=replace(state, accepted=several))
    text = in_short(replace(closed, traced=traced))
    assert f"lacked {titles[0]}, a compliant base and gravity; here they are" in text


def test_an_effect_that_changes_little_is_said_so() -> None:
    closed = fake_closed()
    closed = replace(closed, before=closed.after)
    text = lacked(closed)
    assert "left the held-out error at 1.02" in text
    assert "K_CR stayed at" in text


def test_linear_effects_show_what_the_posterior_says() -> None:
    closed = fake_closed(family="linear")
    text = lacked(closed)
    assert text.startswith("The model lacked a reflex of the hand (")
    assert "(2 parameters)" in text
    mean = closed.analysis.posterior.summary()["kh"]["mean"]
    assert f"{mean:.0f}"[:2] in text


def test_of_a_drift_what_changed_most_is_named() -> None:
    text = lacked(fake_closed(family="time-varying"))
    assert "lacked a grip that changes during the recording (kh ends at 1.58 times" in text
    assert "parameter" not in text


@pytest.mark.parametrize(
    "made, force, rest",
    [(("unexplained", "linear"), False, True), (("explained", "nonlinear"), True, False)],
)
def test_wider_intervals_say_what_widens_them(
    made: tuple[str, str], force: bool, rest: bool
) -> None:
    closed = fake_closed(*made)
    assert widened(closed) == ""
    posterior = closed.analysis.posterior
    middle = posterior.draws.mean(axis=0)
    wide = replace(posterior, chains=middle + 2 * (posterior.chains - middle))
    analysis = FakeAnalysis(**{**vars(closed.analysis), "widened": wide})
    text = widened(replace(closed, analysis=analysis))
    assert text.startswith("The intervals of m1")
    assert ("the force that was taken off" in text) == force
    assert ("what is unexplained may bend the response" in text) == rest


def test_two_effects_are_both_named() -> None:
    closed = fake_closed(family="linear")
    state = closed.traced.state
    both = (*state.accepted, *fake_closed().effects)
    closed = replace(closed, traced=replace(closed.traced, state=replace(state, accepted=both)))
    text = lacked(closed)
    assert "a reflex of the hand" in text and " and dry (Coulomb) friction" in text
    assert "adding them (3 parameters)" in text
    assert [row.name for row in found(closed)] == ["reflex", "coulomb_friction"]


@pytest.mark.parametrize(
    "names, taken",
    [
        (["sample_jitter"], "taken for noise"),
        (["quantisation"], "taken for noise"),
        (["mains_tone"], "mended"),
        (["quantisation", "held_samples"], "mended"),
    ],
)
def test_what_cannot_be_mended_is_not_said_to_be(names: list[str], taken: str) -> None:
    closed = fake_closed(family="linear")
    kinds = [effect_class(name) for name in names]
    seen = tuple(Accepted(e.name, e.title, e.family, "seen in the samples") for e in kinds)
    tried = tuple(Candidate(e.name, e.title, 20.0, True, 0) for e in kinds)
    state = replace(closed.traced.state, accepted=seen)
    closed = replace(closed, traced=replace(closed.traced, state=state, candidates=tried))
    assert f"here that is {taken}" in in_short(closed)
    assert ("mending that" in lacked(closed)) == (taken == "mended")
    assert subject(closed) == f"the recording with what was found {taken}"
    (*_, fate) = candidates(closed)[0]
    assert ("mended" in fate) == (names[0] == "mains_tone")


def test_consistent_says_that_there_is_nothing() -> None:
    closed = fake_closed("consistent")
    (text,) = verdict(closed)
    assert text.startswith("Nothing to find: 3 tests")
    assert headline(closed).status == "safe"
    assert "explains the recording" in " ".join(headline(closed).details)


@pytest.mark.parametrize("family", FAMILIES)
def test_unexplained_says_class_place_trials_widening_and_what_next(family: str) -> None:
    closed = fake_closed("unexplained", family)
    text = " ".join(verdict(closed))
    assert f"Its class is {family}" in text and "times)" not in text
    assert ("around 87" in text) == (family == "linear")
    assert "Tried without success" in text
    assert "was widened" in text
    assert "What to measure next" in text
    head = headline(closed)
    status, said = {
        "linear": ("caution", "unexplained"),
        # Over the velocity: damping that may be its part.
        "nonlinear": ("untrusted", "no law of friction explains"),
        "time-varying": ("untrusted", "not the same at the end"),
    }[family]
    assert head.status == status and said in head.sentence
    # A page that recommends nothing tells nobody to use a number of it.
    assert ("Use its lower end" in text) == (status != "untrusted")
    assert ("for comparison only" in text) == (status == "untrusted")


def test_no_law_of_friction_is_said_to_fail_that_was_not_asked() -> None:
    """Through a reference forces are looked for, and not fitted: dry friction was no other law."""
    closed = fake_closed("unexplained", "nonlinear")
    recording = closed.analysis.etfe.recording
    assert recording is not None
    read = replace(recording, reference=recording.force)
    etfe = replace(closed.analysis.etfe, recording=read)
    vars(closed.analysis)["etfe"] = etfe
    said = headline(closed).sentence
    assert "which is not fitted through a reference" in said and "no law of friction" not in said


def test_far_beyond_the_noise_no_stiffness_is_recommended() -> None:
    closed = fake_closed("unexplained", misfit=13.0)
    head = headline(closed)
    assert head.status == "untrusted"
    assert "no effect that was tried explains it" in head.sentence


def test_an_explained_misfit_is_no_objection_any_more() -> None:
    closed = fake_closed()
    assert headline(closed.base).status == "untrusted"
    head = headline(closed)
    assert head.status == "safe"
    assert "lacked dry (Coulomb) friction" in head.details[0]


def test_assumptions_say_what_was_added_and_widened() -> None:
    closed = fake_closed()
    text = " ".join(assumptions(closed.analysis, closed))
    assert "but for what was found (dry (Coulomb) friction" in text
    assert "adds 3 % (sd) to the limit" in text
    closed = fake_closed("unexplained")
    text = " ".join(assumptions(closed.analysis, closed))
    assert "widened by what is left unexplained" in text
    assert "widened" not in " ".join(assumptions(closed.analysis))


def test_assumptions_say_that_a_force_in_no_column_belongs_to_the_device() -> None:
    text = " ".join(assumptions(fake_closed().analysis))
    assert "without virtual damping the limit may be far lower" in text


def test_assumptions_say_that_no_sensor_of_the_hand_drove_the_device() -> None:
    analysis = fake_closed().analysis
    assert "power assist, admittance control" in " ".join(assumptions(analysis))
    analysis.etfe = replace(analysis.etfe, recording=None)  # a table of a response
    assert "power assist" not in " ".join(assumptions(analysis))


def test_assumptions_say_that_a_sweep_hides_what_changes() -> None:
    analysis = fake_closed().analysis
    recording = analysis.etfe.recording
    assert recording is not None
    assert "sweep" not in " ".join(assumptions(analysis))
    time_s = np.arange(recording.samples) * recording.period_s
    force = np.sin(2 * np.pi * (5 + 100 * time_s / time_s[-1]) * time_s)
    analysis.etfe = replace(analysis.etfe, recording=replace(recording, force=force))
    text = " ".join(assumptions(analysis))
    assert "A sweep comes by each frequency at a moment of its own" in text


# ---- tables


def test_tables_hold_what_the_loop_holds() -> None:
    closed = fake_closed(family="linear")
    (effect,) = found(closed)
    assert effect.ties == "further mass in the hand or arm"
    assert effect.told_apart_by == "Another posture or a relaxed grip."
    assert len(effect.parameters) == 2
    rows = {row[0]: row for row in outcomes(closed)}
    assert rows["residual, band by band"][2:] == ("9.0, beyond", "4.5", "1.0", "4.5")
    assert candidates(closed)[0][1:] == ("reflex of the hand", "300", "accepted")
    assert [row[0] for row in errors(closed)][1] == "residual over the noise, data held out"
    assert errors(closed)[1][1:] == ("1.60", "1.02")
    assert errors(closed)[-1][0] == "critical stiffness, median (90 %)"
    assert all(set(row[1:]) != {"–"} for row in errors(closed))  # what is missing is left out


def test_tests_are_named_in_words_with_their_units_and_zero_has_no_sign() -> None:
    closed = fake_closed(family="linear")
    some = replace(closed.traced.before[0], statistic=-0.04)
    tests = tuple(replace(some, name=name) for name in (SPEED, *(wave.test for wave in WAVES)))
    closed = replace(closed, traced=replace(closed.traced, before=tests, after=()))
    (speed, _, found, *_), *ripples = outcomes(closed)
    assert speed == "a command that gives less at speed, like u |v|" and found == "0.0"
    chance = ", \N{MINUS SIGN}log10 of its chance"
    assert [row[0] for row in ripples] == [wave.title + chance for wave in WAVES]


def test_numbers_beside_the_posterior_stand_in_the_parameter_table() -> None:
    (row,) = estimates(fake_closed())
    assert (row.name, row.unit, row.posterior) == ("friction force", "N", "0.593 ± 0.020")
    assert "beside the posterior" in row.remarks
    drift = estimates(fake_closed(family="time-varying"))
    assert [row.name for row in drift] == ["kh", "bh"]
    assert estimates(fake_closed(family="linear")) == ()


def test_before_and_after_stand_beside_the_measurement() -> None:
    labels = [row.label for row in loop_stiffness.rows(fake_closed())]
    assert labels[0] == "model as declared"
    assert "model with what was added" in labels and "measurement alone" in labels
    labels = [row.label for row in loop_stiffness.rows(fake_closed("unexplained"))]
    assert "the same, widened" in labels


# ---- the force


def test_the_curve_of_the_force_is_the_friction() -> None:
    """Around the linear part of the bench, what is left over the velocity is its dry friction."""
    etfe = estimate_etfe(read_recording(RECORDINGS / "lhifam-user-b.csv.gz"))
    model = build_model("grasped", "lhifam")
    hand = {"bs": 75.0, "ks": 49e3, "mh": 1.21, "bh": 22.5, "kh": 181.0}
    truth = dict(zip(model.names, model.values, strict=True)) | hand
    theta = np.array([truth[name] for name in model.names])
    fit = summarise(model, compress(etfe, partial(model.response, theta)), theta)
    assert etfe.recording is not None
    moving = motions(fit, etfe.recording)
    curve = force_curve(fit, etfe, "velocity", moving["velocity"])
    fast = np.abs(curve.motion) > 0.5 * moving["velocity"].std()
    assert fast.sum() >= 4
    np.testing.assert_allclose(curve.force[fast], -0.6 * np.sign(curve.motion[fast]), rtol=0.1)
    assert np.all(curve.sd[fast] < 0.05)
    # Over the stretch there is no force; what little there is comes from the velocity.
    stretch = force_curve(fit, etfe, "stretch", moving["stretch"])
    assert np.abs(stretch.force).max() < 0.2


# ---- files


def test_a_limit_that_was_widened_has_draws_of_its_own(tmp_path: Path) -> None:
    """What is left of the response bends it draw by draw, in as many as that takes."""
    closed = fake_closed("unexplained", "linear")
    limit = closed.analysis.limit
    some = slice(0, len(limit.samples) // limit.chains // 3 * limit.chains)
    parts = {name: getattr(limit, name)[some] for name in ("samples", "frequency_hz", "group")}
    fewer = replace(limit, **parts)
    vars(closed.analysis)["limit"] = fewer
    page = write_report(closed, tmp_path / "out")
    walls = json.loads((page.parent / "limits.json").read_text())
    assert walls and page.stat().st_size > 0


@pytest.mark.parametrize(
    ("state", "family"),
    [("consistent", "linear"), ("unexplained", "linear"), *(("explained", f) for f in FAMILIES)],
)
def test_the_summary(state: str, family: str) -> None:
    closed = fake_closed(state, family)
    data = summary(closed)
    assert data["diagnosis"]["verdict"] == state
    assert data["diagnosis"]["residual_class"] == (None if state == "consistent" else family)
    assert data["model"]["effects"] == [effect.name for effect in closed.effects]
    assert data["error"]["before"]["held_out_weighted_rms"] == closed.before["weighted_rms"]
    json.dumps(data, allow_nan=False)


@needs_browser
@pytest.mark.parametrize("family", ["linear", "nonlinear"])
def test_the_page_in_a_browser(family: str, tmp_path: Path) -> None:
    closed = fake_closed(family=family)
    page = write_report(closed, tmp_path / "out")
    files = {path.name for path in page.parent.iterdir()}
    assert files & LOOP_FILES == LOOP_FILES - {"loop_force.png"}
    text = html.unescape(page.read_text(encoding="utf-8")).replace("\xa0", " ")
    assert lacked(closed) in text
    order = ("Critical stiffness", "Which walls", "Frequency response", "model lacked</h2>")
    order = (*order, "Parameters</h2>", "Diagnostics</h2>", "What all of this assumes")
    places = [text.index(part, text.index("<main>")) for part in order]
    assert places == sorted(places)
    for width in (1200, 520):
        seen = probe(page, tmp_path, width)
        assert seen["overlaps"] == []
        assert seen["width"] <= seen["window"], "the page scrolls sideways"
    # A plain analysis in the same folder leaves no picture that contradicts it.
    write_report(fake_analysis("rigid"), tmp_path / "out")
    assert not {path.name for path in page.parent.iterdir()} & LOOP_FILES
