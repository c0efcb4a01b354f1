"""What closing the loop adds to the limits of single recordings reaches those of people."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fake_analysis import FakeAnalysis, fake_closed

from bayeshaptic.diagnosis.widening.discrepancy import share_left
from bayeshaptic.diagnosis.widening.law_error import with_law_error
from bayeshaptic.recordings.study import StudyEntry
from bayeshaptic.stability.cases import HELD
from bayeshaptic.study.analysed import Analysed
from bayeshaptic.study.recorded_cases import recorded, signature, widening


def closed(name: str, log_sd: float = 0.0, shift: float = 0.0, family: str = "linear") -> Analysed:
    """A closed loop whose limit is wider than its posterior says."""
    found = fake_closed("explained", family)
    parts = dict(vars(found.analysis))
    rng = np.random.default_rng(1)
    factor = np.exp(shift + log_sd * rng.standard_normal(len(found.analysis.limit.samples)))
    parts["limit"] = replace(parts["limit"], samples=parts["limit"].samples * factor)
    done = replace(found, analysis=FakeAnalysis(**parts))  # type: ignore[arg-type]
    return Analysed(name, StudyEntry(Path(f"{name}.csv"), user=name), done)


def test_effects_and_what_is_unexplained_are_passed_on() -> None:
    some = [closed("ana"), closed("ben", log_sd=0.1), closed("eva", log_sd=0.05, shift=-0.2)]
    found = widening(some)
    # 3200 draws: a standard deviation is known to 1.3 %.
    np.testing.assert_allclose(found.log_sd, [0.0, 0.1, 0.05], atol=0.005)
    np.testing.assert_allclose(found.shift, [0.0, 0.0, -0.2], atol=0.01)
    limit = some[0].analysis.limit  # type: ignore[union-attr]
    wider = found.apply(limit, np.random.default_rng(2))
    ratio = np.log(wider.samples / limit.samples)
    assert ratio.mean() == pytest.approx(-0.2 / 3, abs=0.01)
    assert widening(some[:1]).apply(limit, np.random.default_rng(2)) is limit


def test_no_widening_is_too_small_to_be_passed_on() -> None:
    """What is dropped below a threshold switches between seeds, and by as much as the threshold."""
    one = closed("ana", log_sd=0.02)
    own = np.log(one.analysis.limit.samples).std()  # type: ignore[union-attr]
    for share in (0.02, 0.05, 0.1):
        found = widening([closed("ben", shift=-share * own)])
        np.testing.assert_allclose(found.shift, -share * own, rtol=1e-6)


def test_what_could_hide_keeps_its_shape() -> None:
    """One draw in fifty far down is no wider distribution: it is what a small risk comes from."""
    found = closed("ana")
    limit = found.analysis.limit  # type: ignore[union-attr]
    rng = np.random.default_rng(3)
    factor = np.where(rng.random(len(limit.samples)) < 0.02, 0.7, 1.0)
    hidden = SimpleNamespace(declared=limit)
    parts = dict(vars(found.analysis)) | {
        "limit": replace(limit, samples=limit.samples * factor),
        "hidden": hidden,
    }
    found = replace(found, result=replace(found.result, analysis=FakeAnalysis(**parts)))  # type: ignore[arg-type, type-var]
    narrow = replace(limit, samples=np.full(20_000, 100.0))
    wide = widening([found]).apply(narrow, rng).samples
    assert set(np.round(wide, 6)) == {70.0, 100.0}
    # Four standard deviations of a share of 20,000 draws.
    assert np.mean(wide < 100) == pytest.approx(np.mean(factor < 1), abs=0.004)
    half = widening([found, closed("ben")]).apply(narrow, rng).samples
    assert np.mean(half < 100) == pytest.approx(np.mean(factor < 1) / 2, abs=0.003)


def test_a_case_keeps_its_widened_samples() -> None:
    one = closed("ana", log_sd=0.1)
    (case,) = recorded([one], HELD)
    assert case.label == "user ana" and len(case.draws) == len(case.limit.samples)
    np.testing.assert_array_equal(case.limit.samples, one.analysis.limit.samples)  # type: ignore[union-attr]


def test_recordings_with_different_effects_are_not_alike() -> None:
    reflex, friction = closed("ana"), closed("ben", family="nonlinear")
    assert reflex.effects == ("reflex",) and friction.effects == ("coulomb_friction",)
    assert signature(reflex) != signature(friction)


def test_a_law_that_is_not_quite_right_leaves_every_mass_one() -> None:
    """Without the force the device was another: a load fifty times as heavy, hung on a spring."""
    found = fake_closed("explained")
    posterior, fit = found.analysis.posterior, found.analysis.fit
    heavier = fit.theta * np.where(np.array(fit.model.names) == "m2", 50.0, 1.0)
    wide = with_law_error(posterior, replace(fit, theta=heavier), found.traced)
    assert wide is not None
    chains, before = (p.chains[..., posterior.names.index("m2")] for p in (wide, posterior))
    assert chains.min() > 0
    # The strength is known to 3.4 %, and tests see a ninth of what they saw.
    law = found.traced.state.accepted[0]
    sd = np.sqrt(
        law.estimates["friction_force"].sd ** 2 / law.estimates["friction_force"].mean ** 2
        + share_left(found.traced, "nonlinear") ** 2 / 3
    )
    up = chains > before
    moved = (chains / before - 1)[up] / 49
    assert np.sqrt(np.mean(moved**2)) == pytest.approx(sd, rel=0.1)
    assert 0.4 < up.mean() < 0.6
