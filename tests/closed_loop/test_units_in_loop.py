"""Units of recordings in closed loop: doubted by what holds there, never by the biased response."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
from test_through_reference import following, in_loop, wanted

from bayeshaptic.diagnosis.analyse import analyse
from bayeshaptic.diagnosis.feedback.units_in_loop import with_units_of
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.checks.against_device import compare_response
from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.checks.units_in_doubt import in_doubt
from bayeshaptic.recordings.feedback import Feedback, has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.rig import Bench


def light_one() -> Recording:
    """A device of 0.27 kg with coarse counts that follows trapezoids under a PD controller."""
    bench, share = Bench.from_device("lhifam", False, "free"), 0.05
    bench = replace(
        bench,
        encoder_resolution=30 * bench.encoder_resolution,
        values={name: share * value for name, value in bench.values.items()},
    )
    mass = bench.values["m1"] + bench.values["m2"]
    law = Feedback(mass * 8.0**2, 0.5 * mass * 8.0)
    size = 2 * share * bench.force_rms / law.proportional
    return following(bench, law, wanted("trapezoids", bench, size))


def test_the_response_of_a_loop_is_no_evidence_on_units() -> None:
    """The noise of the encoder through the controller looked like a device of half a gram."""
    recording = light_one()
    biased = compare_response(recording, None, rough_response(recording), slipped=False)
    assert in_doubt("position", biased)
    found = check_recording(recording)
    assert has_feedback(found) and not in_doubt("position", found)


@cache
def fitted(scale: float) -> tuple[Fit, Recording]:
    """A fit through the reference of a loop whose positions are in another unit than is said."""
    recording, bench, _ = in_loop()
    assert recording.reference is not None
    other = replace(
        recording, position=scale * recording.position, reference=scale * recording.reference
    )
    model = build_model("free", None, None, None, bench.period_s)
    return least_squares(model, estimate_etfe(other)), other


@pytest.mark.parametrize(("scale", "doubted"), [(1.0, False), (1e4, True), (1e-3, True)])
def test_a_fit_that_holds_in_the_loop_says_what_units_may_be(scale: float, doubted: bool) -> None:
    fit, recording = fitted(scale)
    found = with_units_of(fit, recording, None, ())
    assert in_doubt("position", found) == doubted


def test_a_report_doubts_the_units_of_a_loop_by_its_fit() -> None:
    recording = fitted(1e4)[1]
    assert not in_doubt("position", check_recording(recording))
    assert in_doubt("position", analyse(recording, "free", ess=100.0).notices)
