"""Closed loops whose reference is known: written down, declared, or read off the recording."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.base.direct import against_direct
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.feedback.mode_above_band import mode_above_band
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals.columns import force_test
from bayeshaptic.diagnosis.residuals.residual import ForceSeen
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares, polish
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import build_model
from bayeshaptic.recordings import join_recordings, read_recording, recording_from_arrays
from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.feedback import Feedback, has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.signals.causality.causality import causality
from bayeshaptic.recordings.signals.controller import controller_reference, share_by_a_law
from bayeshaptic.recordings.through_reference import through_reference
from bayeshaptic.report.headline import headline
from bayeshaptic.report.page.lights import lights
from bayeshaptic.report.page.next_step import next_steps
from bayeshaptic.rig import Bench, WhiteNoise, run_loop, simulate
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

SECONDS = 8.0


def wanted(kind: str, bench: Bench, size: float) -> Floats:
    rng = np.random.default_rng(3)
    count = round(SECONDS / bench.period_s)
    if kind == "noise":
        return size * rng.standard_normal(count)
    if kind == "trapezoids":
        corners = [0.0, 0.0, size, size, 0.0, 0.0, -size, -size, 0.0]
        return np.tile(np.interp(np.arange(2000), 250 * np.arange(9), corners), 10)
    return np.repeat(size * rng.standard_normal(count // 200 + 1), 200)[:count]


def following(bench: Bench, law: Feedback, target: Floats) -> Recording:
    """The bench under a PD controller that answers to every count."""
    last = [0.0]

    def control(k: int, position: float) -> float:
        rate, last[0] = (position - last[0]) / bench.period_s if k else 0.0, position
        return float(law.proportional * (target[k] - position) - law.derivative * rate)

    done = run_loop(bench, control, len(target) * bench.period_s, seed=1)
    return recording_from_arrays(done.force, done.position, bench.period_s, reference=target)


def in_loop(
    kind: str = "noise", held: bool = False, counts: float = 1.0
) -> tuple[Recording, Bench, Feedback]:
    """Under a PD controller of some 3 Hz, whose derivative answers to every count."""
    bench = Bench.from_device("lhifam", held, "grasped" if held else "free")
    bench = replace(bench, encoder_resolution=counts * bench.encoder_resolution)
    mass = bench.values["m1"] + bench.values["m2"]
    law = Feedback(mass * 20.0**2, 0.5 * mass * 20.0)
    target = wanted(kind, bench, 2 * bench.force_rms / law.proportional)
    return following(bench, law, target), bench, law


def excess(recording: Recording, bench: Bench, band_hz: tuple[float, float] | None = None) -> float:
    """Twice the log likelihood that the best fit is ahead of the truth, over its freedom."""
    model = build_model(bench.mechanism, None, None, None, bench.period_s)
    etfe = estimate_etfe(recording, band_hz)
    fit = least_squares(model, etfe)
    truth = np.array([bench.values.get(name, bench.delay_s) for name in fit.model.names])
    truth = np.maximum(truth, 1e-9)
    windows = compress(etfe, partial(fit.model.response, truth))
    both = Likelihood(fit.model, windows)(np.stack([fit.theta, truth]))
    return float(2 * (both[0] - both[1])) / len(truth)


@pytest.mark.parametrize("held", [False, True])
def test_the_truth_is_as_likely_as_noise_lets_it_be(held: bool) -> None:
    recording, bench, _ = in_loop(held=held)
    # 2 dL is a chi-square of 7 or 12 degrees of freedom: over 3 a degree in one of a thousand.
    assert excess(recording, bench) < 3.0


def test_a_coarse_encoder_biases_the_response_and_not_what_is_read_through_the_reference() -> None:
    recording, bench, _ = in_loop(counts=30.0)
    upper = 90.0, 400.0  # over all lines the bias adds up to nothing
    assert excess(recording, bench) < 3.0 and excess(recording, bench, upper) < 3.0
    assert excess(replace(recording, reference=None), bench, upper) > 10.0


def test_in_open_loop_it_is_the_likelihood_of_the_response() -> None:
    bench = Bench.from_device("lhifam", False, "free")
    made = simulate(bench, WhiteNoise(bench.force_rms, 400.0, 0.5, SECONDS), seed=4)
    plain = recording_from_arrays(made.force, made.position, bench.period_s)
    model = build_model("free", None, None, None, bench.period_s)
    band = estimate_etfe(plain).band_hz
    one = least_squares(model, estimate_etfe(plain, band))
    other = least_squares(model, estimate_etfe(replace(plain, reference=plain.force), band))
    inner = np.isfinite(one.sd) & np.isfinite(other.sd)
    assert inner.sum() >= 5
    assert np.all(np.abs(one.theta - other.theta)[inner] < 0.1 * one.sd[inner])
    assert np.all(np.abs(np.log(other.sd / one.sd))[inner] < np.log(1.1))


def test_a_declared_controller_leaves_its_reference() -> None:
    recording, _, law = in_loop()
    told = replace(recording, reference=None, feedback=law)
    found, notices = through_reference(told, check_recording(told))
    assert found.reference is not None and not has_feedback(notices)
    assert recording.reference is not None
    expected = law.proportional * recording.reference[1:]  # its derivative is of the position alone
    np.testing.assert_allclose(found.reference[1:], expected, atol=1e-6 * np.ptp(expected))


def test_a_controller_declared_wrongly_is_not_believed() -> None:
    recording, _, law = in_loop(counts=30.0)
    wrong = replace(law, derivative=-law.derivative)
    told = replace(recording, reference=None, feedback=wrong)
    found, notices = through_reference(told, check_recording(told))
    assert found.reference is None and has_feedback(notices)
    assert any(notice.topic == "reference" for notice in notices)


def test_the_controller_is_read_off_where_its_reference_steps() -> None:
    recording, _, _ = in_loop("steps")
    target, found = recording.reference, controller_reference(recording)
    assert found is not None and target is not None
    changes = np.flatnonzero(np.diff(target))
    assert {int(np.abs(changes - k).min()) for k in np.flatnonzero(found)} <= set(range(8))
    assert controller_reference(in_loop("noise")[0]) is None


def test_a_loop_that_repeats_exactly_is_seen_by_its_law() -> None:
    """Little in it is chance, so that no prediction of it errs: of rubbing ones K_CR was 0.82."""
    recording, _, _ = in_loop("trapezoids")
    assert not causality(replace(recording, reference=None)).has_feedback
    assert share_by_a_law(recording) > 0.9
    assert has_feedback(check_recording(replace(recording, reference=None)))
    assert share_by_a_law(replace(in_loop("noise")[0], reference=None)) == 0


def test_a_loop_that_follows_noise_is_seen_by_its_law_where_that_was_written_down() -> None:
    """A stiff spring to the reference answers so little to chance that predictions do not err."""
    bench = Bench.from_device("lhifam", False, "free")
    bench = replace(bench, encoder_resolution=0.1 * bench.encoder_resolution)
    law = Feedback((bench.values["m1"] + bench.values["m2"]) * 8.0**2)
    target = wanted("noise", bench, bench.force_rms / law.proportional)
    recording = following(bench, law, target)
    assert not has_feedback(check_recording(replace(recording, reference=None)))
    assert share_by_a_law(recording) > 0.99
    found = [n for n in check_recording(recording) if n.topic == "feedback"]
    assert len(found) == 1 and "linear law of positions and reference" in found[0].text


@pytest.mark.parametrize("kind", ["noise", "steps"])
def test_an_open_loop_has_no_law_whatever_stands_beside_it(kind: str) -> None:
    bench = Bench.from_device("lhifam", held=False)
    made = simulate(bench, wanted(kind, bench, bench.force_rms), seed=1)
    recording = recording_from_arrays(made.force, made.position, bench.period_s)
    slow = np.cumsum(made.force - made.force.mean())
    for beside in (made.force, np.roll(made.force, 1), slow, made.position, np.gradient(slow)):
        assert share_by_a_law(replace(recording, reference=beside)) == 0


@pytest.mark.parametrize("early", [0, 1])
@pytest.mark.parametrize("kind", ["noise", "steps", "trapezoids"])
def test_a_motion_without_noise_is_no_law_of_a_controller(kind: str, early: int) -> None:
    bench = Bench.from_device("lhifam", held=False).quiet()
    force = wanted(kind, bench, bench.force_rms)
    made = simulate(bench, force, seed=1)
    position = np.roll(made.position, -early)
    recording = recording_from_arrays(made.force, position, bench.period_s)
    assert share_by_a_law(recording) == 0


def test_a_reference_that_says_nothing_leaves_the_warning() -> None:
    recording, _, _ = in_loop()
    slow = np.sin(np.arange(recording.samples) * 2e-3)
    begun = begin(replace(recording, reference=slow), "free", Options())
    assert has_feedback(begun.notices) and not begun.etfe.through_reference
    with pytest.raises(InputError, match="the reference moves the force in"):
        estimate_etfe(replace(recording, reference=slow))


def test_a_reference_is_read_cut_and_joined(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.arange(600) * 1e-3, rng.standard_normal((600, 3))])
    path = tmp_path / "loop.csv"
    np.savetxt(path, rows, delimiter=",", header="time_s,force_n,position_m,aim", comments="")
    whole = read_recording(path, columns={"reference": "aim"})
    part = read_recording(path, columns={"reference": "aim"}, rows=(101, 600))
    assert read_recording(path).reference is None
    assert whole.reference is not None and part.reference is not None
    np.testing.assert_allclose(part.reference, rows[100:, 3])
    joined = join_recordings([whole, part])
    assert joined.reference is not None and len(joined.reference) == joined.samples
    assert join_recordings([whole, replace(part, reference=None)]).reference is None


def test_one_mass_that_rubs_is_followed_in_time_although_its_reference_was_written_down() -> None:
    """Through the reference its dry friction was a damper, four times the true one."""
    force = Bench.from_device("lhifam", False, "rigid").force_rms
    bench = Bench.from_device("lhifam", False, "rigid").with_effect(
        "coulomb_friction", force=0.3 * force
    )
    mass, rng = bench.values["m"], np.random.default_rng(3)
    law = Feedback(mass * 20.0**2, 0.5 * mass * 20.0)
    time_s = np.arange(round(SECONDS / bench.period_s)) * bench.period_s
    tones = zip(rng.uniform(0.3, 4, 12), rng.uniform(0, 6, 12), strict=True)
    target = np.sum([np.sin(2 * np.pi * f * time_s + p) for f, p in tones], axis=0)
    target += 0.02 * np.std(target) * rng.standard_normal(len(time_s))
    target *= 0.57 * force / law.proportional
    made = following(bench, law, target)
    closed = close_loop(made, hidden=False, held=False, ess=200)
    assert closed.effect_names == ("coulomb_friction",)
    found = closed.analysis.posterior.summary()
    for name, truth in (("m", mass), ("b", bench.values["b"]), ("coulomb", 0.3 * force)):
        assert abs(found[name]["mean"] - truth) < 4 * found[name]["sd"], name


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"model": "free", "band_hz": (1.0, 300.0)}, "Set aside: the base model free"),
        ({"modes": 1, "band_hz": (1.0, 300.0)}, "Set aside: the base model free"),
        ({"model": "rigid"}, "The reference is not used: one mass is followed in time"),
        ({}, "The reference is not used: "),
    ],
)
def test_what_one_mass_that_is_followed_sets_aside_is_said(given: dict, words: str) -> None:
    """A reference that was given, though of no use, is not advised to be written down."""
    bench = Bench.from_device("lhifam", False, "rigid")
    law = Feedback(bench.values["m"] * 20.0**2, 0.5 * bench.values["m"] * 20.0)
    made = following(bench, law, wanted("steps", bench, 2 * bench.force_rms / law.proportional))
    if given != {"model": "rigid"}:  # it answers to the motion
        made = replace(made, reference=made.force)
    closed = close_loop(made, hidden=False, ess=50, **given)
    assert closed.analysis.in_loop is not None
    # Of a reference that nothing is wrong with there is nothing to beware of.
    level = "note" if given == {"model": "rigid"} else "warning"
    told = [n.text for n in closed.analysis.notices if n.level == level]
    assert any(words in text for text in told)
    # The response is spoiled, the motion is not, where the page recommends what that says.
    recommended = headline(closed).stiffness is not None
    assert (lights(closed)[0].state == "bad") is not recommended
    doubted = replace(closed.analysis.in_loop, doubts=("in doubt",))
    result = replace(closed, analysis=replace(closed.analysis, in_loop=doubted))
    # Whatever the doubt is: of a delay that was given it said "halves disagree".
    assert lights(result)[1].word == "in doubt"
    steps = next_steps(headline(result), result)
    assert steps and not any("reference" in step.text for step in steps)


def test_a_force_that_all_lines_show_speaks_against_what_the_reference_moves() -> None:
    """A mass that rubs, read as two masses without friction: 1.74 times its limit, with caution."""
    recording, _, _ = in_loop()
    closed = close_loop(recording, held=False, band_hz=(1.0, 400.0), hidden=False, ess=100)
    assert closed.analysis.etfe.through_reference and headline(closed).stiffness is not None
    seen = force_test("sign(v)", 10.1, ForceSeen(1.0, 0.1, 1.0))
    (against,) = against_direct(closed.analysis.fit, (seen,), through=True)
    notices = (*closed.analysis.notices, against)
    told = headline(replace(closed, analysis=replace(closed.analysis, notices=notices)))
    assert told.stiffness is None and "a force that is not linear" in told.sentence


def test_a_mode_among_few_windows_is_doubted_where_one_above_them_explains_as_much() -> None:
    bench = Bench.from_device("phantom")
    made = simulate(bench, WhiteNoise(0.05, 200.0, 0.7, 20.0), seed=2)
    recording = recording_from_arrays(**made.signals, encoder_resolution=1e-5)
    bare = build_model("free", None, bench.delay_s, 0.0, bench.period_s)
    model = least_squares(bare, estimate_etfe(recording)).model  # whose priors are set
    truth = np.array([max(bench.values[name], 1e-9) for name in model.names])

    def doubts(etfe: Etfe, theta: Floats) -> tuple[Notice, ...]:
        windows = compress(etfe, partial(model.response, truth))
        fit = summarise(model, windows, polish(model, windows, theta))
        limit = critical_stiffness(fit.model, fit.theta * np.linspace(0.99, 1.01, 50)[:, None])
        return mode_above_band(fit, etfe, limit)

    assert not doubts(estimate_etfe(recording), truth)  # with the mode itself among 80 windows
    slow = estimate_etfe(recording, (1.0, 12.0))
    own = dict(zip(model.names, truth, strict=True))
    for mode_hz in (3.0, 4.0, 5.0, 6.0, 8.0):  # wherever among the nine windows a fit begins
        omega = 2 * np.pi * mode_hz
        inside = own | {"kc": own["m2"] * omega**2, "bc": 0.05 * own["m2"] * omega}
        found = doubts(slow, np.array([inside[name] for name in model.names]))
        assert [notice.topic for notice in found] == ["valley"]
