"""The limits that a rendering program loads."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.models import build_model
from bayeshaptic.report.figures.style import drawn
from bayeshaptic.report.figures.walls import kb
from bayeshaptic.report.numbers.rules import least_damped, rules_of
from bayeshaptic.report.walls.section import limits_section
from bayeshaptic.stability.cases import Case
from bayeshaptic.stability.walls.damping import Backward, LowPass
from bayeshaptic.stability.walls.joint import joint_region
from bayeshaptic.stability.walls.limit_table import limit_table
from bayeshaptic.stability.walls.region import kb_region
from bayeshaptic.stability.walls.tail import lower_tail

COMPARE = (np.less, np.less_equal)


def case(name, device="lhifam", spread=0.03, draws=2400, label="held", group="held", seed=1):
    model = build_model(name, device, delay_sd_s=20e-6)
    rng = np.random.default_rng(seed)
    values = model.values * np.exp(spread * rng.standard_normal((draws, model.size)))
    return Case(label, group, model, values, bh.critical_stiffness(model, values))


@pytest.fixture(scope="module")
def one():
    return case("grasped")


@pytest.fixture(scope="module")
def table(one):
    return limit_table([one], [Backward(), LowPass(80.0)])


def test_json_is_strict_and_has_every_limit(table, one):
    found = json.loads(table.as_json("lhifam", "safe"), parse_constant=pytest.fail)
    assert found["format"] == "bayeshaptic limits 1"
    assert (found["device"], found["status"], found["period_s"]) == ("lhifam", "safe", 1e-3)
    assert (found["stiffness_unit"], found["damping_unit"]) == ("N/m", "N s/m")
    assert found["stiffness"]["0.05"] == pytest.approx(one.limit.safe(0.05), rel=1e-5)
    assert found["stiffness"]["0.001"] == pytest.approx(one.limit.safe(0.001), rel=1e-5)
    assert [c["label"] for c in found["cases"]] == ["held"]
    backward, low_pass = found["boundaries"]
    assert (backward["damping_filter"], backward["cutoff_hz"]) == ("backward", None)
    assert low_pass["damping_filter"] == "low_pass"
    assert low_pass["smoothing"] == pytest.approx(np.exp(-2 * np.pi * 80.0 * 1e-3))
    for part in found["boundaries"]:
        assert part["damping"][0] == 0.0
        assert np.all(np.diff(part["damping"]) > 0)
        assert len(part["stiffness"]["0.01"]) == len(part["damping"])
        assert part["stiffness"]["0.01"][0] == pytest.approx(found["stiffness"]["0.01"], rel=2e-3)


def test_csv_has_the_same_numbers_and_units_in_its_heads(table):
    rows = list(csv.DictReader(table.as_csv().splitlines()))
    found = table.as_dict()["boundaries"]
    assert len(rows) == sum(len(part["damping"]) for part in found)
    last = rows[-1]
    assert last["damping_filter"] == "low_pass" and float(last["cutoff_hz"]) == 80.0
    assert float(last["damping_N_s_per_m"]) == found[1]["damping"][-1]
    assert float(last["stiffness_N_per_m_at_risk_0.05"]) == found[1]["stiffness"]["0.05"][-1]
    first = next(row for row in rows if row["damping_filter"] == "low_pass")
    small = found[1]["stiffness"]["0.001"]
    assert float(first["stiffness_N_per_m_at_risk_0.001"]) == small[0] > 0


def test_what_is_not_stated_is_empty_in_csv(one):
    few = replace(one.limit, samples=one.limit.samples[:60], chains=1)
    found = limit_table([replace(one, draws=one.draws[:60], limit=few)], [LowPass(80.0)])
    assert found.filters[0].boundary(0.001) is None
    rows = list(csv.DictReader(found.as_csv().splitlines()))
    assert {row["stiffness_N_per_m_at_risk_0.001"] for row in rows} == {""}


def test_the_risk_is_what_it_says(table, one):
    for part in table.filters:
        region = kb_region(one, part.kind, draws=len(one.draws))
        for risk in (0.05, 0.01):
            boundary = part.boundary(risk)
            limits = region.limits(boundary.damping)
            inside = boundary.stiffness > 0
            below, upto = (np.mean(c(limits, boundary.stiffness), axis=0) for c in COMPARE)
            assert np.all(((below < risk) & (upto >= risk - 1e-9) | ~inside)[1:])
            assert boundary.stiffness[0] == one.limit.safe(risk)  # as stated everywhere else
            b, k = boundary.damping[10], boundary.stiffness[10]
            assert region.probability(k * (1 - 1e-6), b) == pytest.approx(1 - below[10], abs=1e-9)


def test_straight_lines_between_rows_are_on_the_safe_side(table, one):
    for part in table.filters:
        region = kb_region(one, part.kind)
        boundary = part.boundary(0.05)
        between = 0.5 * (boundary.damping[1:] + boundary.damping[:-1])
        line = np.interp(between, boundary.damping, boundary.stiffness)
        truth = region.quantile(0.05, between)
        assert np.all(line <= truth + 2e-3 * boundary.stiffness.max())


def test_a_device_is_stable_where_all_of_its_cases_are():
    one = case("grasped", draws=900)
    bare = case("free", label="nobody holds it", group="free", draws=600, seed=2)
    region = joint_region([bare, one])
    stiffness, levels = np.array([5e3, 2.15e4, 2.2e4, 5e4]), np.array([0.0, 60.0])
    each = [kb_region(c).probability_map(stiffness, levels) for c in (bare, one)]
    np.testing.assert_allclose(region.probability_map(stiffness, levels), each[0] * each[1])
    together = limit_table([bare, one], [LowPass(80.0)])
    for part in together.filters:
        alone = [kb_region(c, part.kind).quantile(0.05, part.damping) for c in (bare, one)]
        assert np.all(part.quantile(0.05) <= np.minimum(*alone) * (1 + 1e-9))
    assert together.stiffness[0] <= 1.01 * min(c.limit.safe(0.05) for c in (bare, one))
    assert [c["group"] for c in together.as_dict()["cases"]] == ["free", "held"]


def test_rotational_devices_have_their_units():
    found = limit_table([case("free", "phantom", draws=100)])
    assert (found.unit, found.damping_unit) == ("N m/rad", "N m s/rad")
    assert "stiffness_N_m_per_rad_at_risk_0.05" in found.as_csv().splitlines()[0]


def test_loops_that_are_never_stable_have_limits_of_zero(one):
    values = np.array(one.draws[:100])
    values[:, one.model.names.index("kh")] = -5e3
    limit = bh.critical_stiffness(one.model, values)
    found = limit_table([replace(one, draws=values, limit=limit)])
    assert set(found.filters[0].quantile(0.05)) == {0.0}
    json.loads(found.as_json(), parse_constant=pytest.fail)
    assert limits_section(found).html


def test_loops_that_are_never_stable_have_no_small_risks_of_their_own():
    """Many draws of a fit that is unstable however soft the wall is: none is below the others."""
    many = case("grasped", draws=10_500)
    many.draws[:, many.model.names.index("kh")] = -5e3
    never = replace(many, limit=bh.critical_stiffness(many.model, many.draws))
    some = kb_region(never, draws=2000)
    levels = np.zeros(1)
    found = lower_tail(never, some, many.draws[:2000], levels, some.limits(levels), 0.01)
    assert found is None


def test_least_damped_the_case_with_the_least_damping(one):
    bare = case("free", label="nobody holds it", group="free", draws=100)
    rules = least_damped([one, bare], friction=0.01, resolution=1e-6)
    assert (
        rules.label == "nobody holds it"
    )  # 6.9 N s/m to the ground; held 4.1, and 18.3 of the hand


def test_rules_are_the_same_in_whatever_order_the_draws_come():
    """A page tells them twice, from the same draws in two orders."""
    many = case("free", "phantom", draws=10_500, spread=0.05)
    shuffled = np.random.default_rng(0).permutation(many.draws)
    one, other = (rules_of(many.model, draws) for draws in (many.draws, shuffled))
    assert one.rigid() == pytest.approx(other.rigid())
    assert one.passive() == pytest.approx(other.passive())


@pytest.mark.filterwarnings("error")
def test_a_rule_far_above_the_walls_leaves_the_figure_its_size(one, table):
    rules = least_damped([one], friction=0.5, resolution=1e-7)
    above = replace(rules, dampings=10 * rules.dampings)  # eight times the highest wall
    assert drawn(kb.draw(table, above), "limits_kb").png


def test_small_risks_come_from_the_lowest_of_many_draws():
    many = case("free", "phantom", draws=10_500, spread=0.05)
    found = limit_table([many], [LowPass(100.0)], (0.05, 0.01, 0.002), 1500).filters[0]
    boundary = found.boundary(0.002)
    between = found.boundary(0.01)  # neither 1500 draws nor the lowest say it, but a fitted tail
    assert np.all(between.stiffness >= boundary.stiffness)
    assert np.all(between.stiffness <= found.boundary(0.05).stiffness)
    inside = np.flatnonzero(boundary.stiffness > 0)
    assert len(inside) > 15
    assert boundary.stiffness[0] == many.limit.safe(0.002)  # of all draws, as stated elsewhere
    some = inside[1::6]
    truth = kb_region(many, found.kind, draws=10_500).quantile(0.002, boundary.damping[some])
    np.testing.assert_allclose(boundary.stiffness[some], truth, rtol=1e-9)
    assert np.all(boundary.stiffness <= found.boundary(0.05).stiffness)
    ends = np.sort(kb_region(many, found.kind, draws=10_500).largest_damping())
    assert found.width(0.002).damping == pytest.approx(ends[20], rel=1e-5)


def test_a_risk_that_is_stated_without_damping_is_stated_with_it():
    many = case("grasped", draws=24_000)
    known = limit_table([many], [LowPass(100.0)]).filters[0].boundary(0.001)
    index = np.arange(0, 24_000, 10)
    few = replace(
        many, draws=many.draws[index], limit=bh.critical_stiffness(many.model, many.draws[index])
    )
    found = limit_table([few], [LowPass(100.0)])
    part = found.filters[0]
    assert not part.region.says(0.001) and part.tails is None
    boundary, larger = part.boundary(0.001), part.boundary(0.01)
    assert boundary.stiffness[0] == few.limit.safe(0.001)
    assert np.all(boundary.stiffness <= larger.stiffness)
    inside = known.stiffness > 0
    stiffness = np.interp(known.damping[inside], boundary.damping, boundary.stiffness)
    five = np.interp(known.damping[inside], part.damping, part.boundary(0.05).stiffness)
    # As well as a tail is asked to be known: a fifth of the 90 % interval, which is 3.3 standard
    # deviations where that from 5 to 0.1 % is 1.4.
    off, wide = np.abs(stiffness - known.stiffness[inside]), five - known.stiffness[inside]
    assert off.max() < 0.2 * 3.3 / 1.4 * wide.max()
    assert "too few draws" not in limits_section(found).html


def test_the_same_over_several_cases():
    cases = [case("grasped", seed=1), case("grasped", label="another", seed=2)]
    both, one = limit_table(cases, [LowPass(100.0)]), limit_table(cases[:1], [LowPass(100.0)])
    part = both.filters[0]
    assert not part.region.says(0.001) and part.tails is None
    boundary, alone = part.boundary(0.001), one.filters[0].boundary(0.001)
    assert boundary is not None and alone is not None
    assert np.all(boundary.stiffness <= part.boundary(0.01).stiffness)
    # The lowest of two alike at 0.1 % is one of them at 0.05 %.
    at = boundary.damping[1:15]
    stiffness = np.interp(at, alone.damping, alone.stiffness)
    assert np.all(boundary.stiffness[1:15] < 1.01 * stiffness)
    assert np.all(boundary.stiffness[1:15] > 0.95 * stiffness)


def test_no_boundary_is_stated_where_the_stiffness_without_damping_is_not(one):
    few = replace(one.limit, samples=one.limit.samples[:60], chains=1)
    found = limit_table([replace(one, draws=one.draws[:60], limit=few)], [LowPass(80.0)])
    for risk, stiffness in zip(found.risks, found.stiffness, strict=True):
        assert (found.filters[0].boundary(risk) is None) or stiffness is not None
    assert found.stiffness[found.risks.index(0.01)] is None
