"""The paper reproduced: numbers beside the published ones, with tolerances from their rounding."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import bayeshaptic as bh

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "examples"))

from paper import evidence, hypotheses, identification, margins, relays, residuals, rule_map, tables  # noqa: E402
from paper.published import (  # noqa: E402
    BIN_HZ,
    CASES,
    LEVER_M,
    TABLES,
    delay_s,
    relays as published_relays,
    values,
)
from paper.relay_data import RelayData  # noqa: E402


@pytest.fixture(scope="module")
def table_3() -> dict[tuple[str, str], margins.Margin]:
    return {one.case: one for one in margins.table_3()}


@pytest.fixture(scope="module")
def runs() -> dict[tuple[str, str], relays.RelayRun]:
    return {run.case: run for run in relays.relay_runs()}


def test_numbers_in_the_text_are_those_that_are_computed() -> None:
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    users, _ = published_relays("phantom", "grasped")
    apart, sd = np.ptp(users), users.std(ddof=1)
    assert f"Open: six users, {apart:.1f} dB apart" in text
    assert f"their standard deviation is {sd:.1f} dB" in text
    model = bh.free(device="lhifam")
    told = float(re.search(r"stands ([\d.]+) % from it", text)[1])  # type: ignore[index]
    kc = model.names.index("kc")
    theta = np.tile([model.reference[name] for name in model.names], (2, 1))
    theta[:, kc] *= 1 - (told + np.array([-0.01, 0.01])) / 100
    before, after = bh.critical_stiffness(model, theta).frequency_hz
    assert before < 10 < 100 < after


# Table III


@pytest.mark.parametrize("case", CASES)
def test_published_margins_lie_in_the_rounding_box(table_3, case):
    one = table_3[case]
    low, high = one.continuous_box_db
    # The published figure is rounded too: half of 0.01 dB.
    assert low - 0.005 <= one.published[0] <= high + 0.005
    if case != ("lhifam", "grasped"):
        low, high = one.exact_box_db
        assert low - 0.005 <= one.published[0] <= high + 0.005


def test_the_held_lhifam_is_the_approximation_and_not_the_exact_hold(table_3):
    one = table_3["lhifam", "grasped"]
    assert one.continuous == pytest.approx(one.published, abs=0.0051)
    assert one.exact_box_db[0] > one.published[0] + 0.09


def test_the_rounding_box_holds_what_rounds_to_the_published_parameters(table_3):
    from bayeshaptic.models import build_model
    from bayeshaptic.stability import critical_stiffness

    rng = np.random.default_rng(0)
    for case in CASES:
        model = build_model(case[1], case[0])
        half = np.array([margins.HALF_UNITS[case][name] for name in model.names])
        inside = model.values + half * rng.uniform(-1, 1, (200, model.size))
        gain = critical_stiffness(model, inside).db([0.0, 1.0])
        low, high = table_3[case].exact_box_db
        assert low - 1e-3 <= gain[0] and gain[1] <= high + 1e-3


def test_the_rigid_rule_at_the_tip():
    one = margins.rigid_margin()
    assert one.rule_box[0] < one.published < one.rule_box[1]
    assert one.rule == pytest.approx(0.0085 / (0.65e-3 * LEVER_M**2))


# Tables I and II


@pytest.mark.parametrize("case", [("phantom", "free"), ("lhifam", "grasped")])
def test_parameters_identified_back_hold_the_published_ones(case):
    found = identification.identify(case, ess=400)
    published = values(*case)
    for row in found.rows:
        if case == ("phantom", "free") and row.name in ("b1", "b2"):
            continue  # b2 is zero, the edge of what it can be; the next lines take their sum
        assert row.covered, row
    grounded = [found.posterior.names.index(name) for name in ("b1", "b2")]
    total = found.posterior.draws[:, grounded].sum(axis=1)
    low, high = np.quantile(total, [0.005, 0.995])
    assert low <= published["b1"] + published["b2"] <= high
    low, high = found.limit.db([0.005, 0.995])
    truth = {one.case: one.exact[0] for one in margins.table_3()}[case]
    # With b2 at its edge the interval lies to one side: half a unit of the published 0.01 dB.
    assert low - 0.005 <= truth <= high + 0.005


def test_the_hand_at_the_tip():
    held = values("phantom", "grasped")
    assert held["mh"] / LEVER_M**2 == pytest.approx(TABLES["human_at_tip"]["mh_kg"], abs=4e-4)
    # Half a unit of 1.42 is 0.35 N/m at the tip; bh is outside of its rounding: the page says so.
    assert held["kh"] / LEVER_M**2 == pytest.approx(TABLES["human_at_tip"]["kh_n_per_m"], abs=0.36)
    assert abs(held["bh"] / LEVER_M**2 - TABLES["human_at_tip"]["bh_ns_per_m"]) > 5e-4 / LEVER_M**2


# Table IV


@pytest.mark.parametrize("case", CASES)
def test_relay_and_prediction_agree_or_it_is_said_where_the_relay_settled(runs, table_3, case):
    run = runs[case]
    # At its own frequency the relay measures the response itself.
    assert abs(run.check.difference_db) < 3 * run.measured.gain_margin_sd_db + 0.06
    if case[1] == "grasped":
        assert run.measured.critical_db is not None and run.measured.critical_sd_db is not None
        distance = run.measured.critical_db - table_3[case].exact[0]
        assert abs(distance) < 3 * run.measured.critical_sd_db
    assert run.check.binds == (case != ("lhifam", "free"))


def test_a_sampled_relay_settles_where_it_is_let_go():
    measured = [run.measured for run in relays.let_go()]
    gains = [one.gain_margin_db for one in measured]
    assert max(gains) - min(gains) > 4
    # Slow drifts of the double integrator leave a quarter of a degree.
    assert all(abs(one.phase_deg) < one.phase_bound_deg + 0.25 for one in measured)


def test_published_frequencies_are_bins():
    for name, width in BIN_HZ.items():
        _, hertz = published_relays(*name.split("_"))
        np.testing.assert_allclose(hertz / width, np.round(hertz / width), atol=0.02)


# What the paper left open


def test_the_evidence_of_a_gaussian_is_known():
    data, sd = np.array([0.5, -1.0, 2.0]), 0.3

    def log_likelihood(z):
        return (-0.5 * ((z - data) / sd) ** 2 - np.log(sd * np.sqrt(2 * np.pi))).sum(axis=1)

    found = evidence.evidence(log_likelihood, 3)
    variance = 1 + sd**2
    truth = (-0.5 * data**2 / variance - 0.5 * np.log(2 * np.pi * variance)).sum()
    assert found.log_evidence == pytest.approx(truth, abs=0.15)
    np.testing.assert_allclose(found.draws.mean(axis=0), data / variance, atol=0.06)
    np.testing.assert_allclose(found.draws.std(axis=0), sd / np.sqrt(variance), rtol=0.15)


def test_the_density_of_relay_data_is_one_over_all_data():
    gain, step = np.arange(20.0, 25.0, 0.05), 0.05
    hertz = np.arange(10.0, 26.0, 0.1)
    system = hypotheses.Hypothesis("", ("phantom", "free"), 0.0).system(np.zeros((1, 6)))
    total = 0.0
    for one in hertz:
        centre = -20 * np.log10(np.abs(system.sampled_response(np.array([one]), 1e-3)[0, 0]))
        near = centre + gain - 22.5
        data = RelayData(near, np.full(len(near), one), 0.1, 0.3)
        total += float(np.exp(data.log_likelihood(system)).sum()) * step * 0.1
    # Of the relay's range of phases, what the band of 10 to 26 Hz covers.
    phase = np.degrees(np.angle(-system.sampled_response(hertz, 1e-3)[0]))
    bound = 0.18 * hertz
    share = np.sum((np.abs(phase) < bound)[:-1] * np.abs(np.diff(phase)) / (2 * bound[:-1]))
    assert total == pytest.approx(share, rel=0.1)


def test_the_frequency_explains_the_users_and_not_the_free_device():
    users = residuals.at_own_frequency(residuals.USERS)
    gain, _ = published_relays(*residuals.USERS)
    assert gain.std(ddof=1) > 1.6 and users.std(ddof=1) < 0.35
    assert users.mean() == pytest.approx(2.0, abs=0.1)
    free = residuals.at_own_frequency(residuals.PHANTOM)
    assert np.all((free > -3.4) & (free < -2.7))


def test_hands_move_the_limit_little_and_damping_moves_it_much():
    moved = residuals.sensitivities()
    assert moved["ks"] == pytest.approx(0.67, abs=0.02)
    assert max(abs(moved[name]) for name in ("bs", "mh", "bh", "kh")) < 0.12
    assert moved["b1"] == pytest.approx(6.0, abs=0.1)


def test_residual_b_prefers_what_lowers_the_gain():
    table, delay, friction, spring, *_ = residuals.phantom_hypotheses()
    weighed = hypotheses.weigh(
        [table, delay, friction, spring], residuals.data(residuals.PHANTOM, 0.3)
    )
    logs = np.array([one.evidence.log_evidence for one in weighed])
    assert logs[3] > logs[0] + 15  # a factor of e^20 on the page
    assert logs[2] < logs[0] and logs[1] < logs[0] + 8
    low, middle, high = weighed[3].factors()["spring"]
    assert 1.3 < low < 2.0 < middle < 2.8 < high < 3.5  # N m/rad; the three trials give 2.3 to 3.05


# The rule


def test_the_map_of_the_rule():
    phantom, lhifam = (rule_map.over_mode_and_delay(device) for device in ("phantom", "lhifam"))
    at = [
        one.error_db[
            np.argmin(np.abs(one.y - delay_s(device))),
            np.argmin(np.abs(one.x - rule_map.mode_hz(device))),
        ]
        for device, one in (("phantom", phantom), ("lhifam", lhifam))
    ]
    assert abs(at[0]) < 0.15 and at[1] < -6
    assert lhifam.error_db.max() > 5  # a soft mode: the rule promises too much
    assert 0.98 < rule_map.jump(rule_map.over_pretension()) < 1.0


# The page


def test_the_page_has_every_table_and_no_empty_one():
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    places = re.findall(r"<!-- (?!end)([\w ]+) -->\n(.*?)\n<!-- end -->", text, re.DOTALL)
    script = (ROOT / "examples" / "reproduce_paper.py").read_text(encoding="utf-8")
    assert len(places) == 14
    for name, table in places:
        assert table.startswith("| "), name
        assert f'"{name}"' in script
    drawn = set(re.findall(r"images/paper/([\w-]+)\.png", text))
    there = {path.stem for path in (ROOT / "docs" / "images" / "paper").glob("*.png")}
    assert there == drawn


def test_the_page_s_table_3_is_what_the_script_makes(table_3):
    text = (ROOT / "docs" / "paper.md").read_text(encoding="utf-8")
    assert tables.table_3(list(table_3.values()), margins.rigid_margin()) in text
