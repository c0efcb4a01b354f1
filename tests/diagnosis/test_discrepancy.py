"""How far the limit is widened by drifts that go on, and by what is left unexplained."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from fake_analysis import _tests, fake_closed

from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.state import Accepted, State, Trial
from bayeshaptic.diagnosis.traced import Traced, share_left
from bayeshaptic.diagnosis.trials.direct import _leaves_little
from bayeshaptic.diagnosis.trials.drift import _edge_error, _ends, _fall, _further, drift_trials
from bayeshaptic.diagnosis.widening.deviation import Deviation, evidence, matern, merged
from bayeshaptic.diagnosis.widening.discrepancy import _lowest_crossing, with_discrepancy
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model, rigid
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings import read_recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.binding import BindingCrossing, as_known
from bayeshaptic.stability.critical import critical_stiffness


def log_ratios(closed: Closed, traced: Traced, base: Fit | None = None) -> np.ndarray:
    """How the limit's draws are changed, in log stiffness."""
    one = closed.analysis
    wide = with_discrepancy(one.limit, one.posterior, base or one.fit, traced)
    return np.log(wide.samples / one.limit.samples)


def with_effects(traced: Traced, **changes: float) -> Traced:
    state = traced.state
    effects = tuple(replace(effect, **changes) for effect in state.accepted)
    return replace(traced, state=replace(state, accepted=effects))


def too_damped(fit: Fit) -> Fit:
    """A base model that is far off."""
    theta = fit.theta.copy()
    for name in ("b1", "bc", "b2"):
        theta[fit.model.names.index(name)] *= 4
    return replace(fit, theta=theta)


def limit_of(fit: Fit) -> float:
    return float(critical_stiffness(fit.model, fit.theta).value)


def test_a_steady_ramp_lies_within_the_fall() -> None:
    closed = fake_closed("explained", "time-varying")
    ratio = log_ratios(closed, with_effects(closed.traced, limit_log_fall=0.1))
    low, high = np.quantile(ratio, [0.05, 0.95])
    assert ratio.min() >= -0.125 and ratio.max() <= 0
    assert low < -0.1 < high, "the ramp itself must be inside the 90 % interval"


def test_a_device_that_was_still_changing_has_settled_or_goes_on() -> None:
    """The device of a stranger warmed up for 14 s: its limit was 1.16 times what it would be."""
    closed = fake_closed("explained", "time-varying")
    traced = with_effects(closed.traced, limit_log_further=0.2)
    ratio = log_ratios(closed, traced)
    assert np.mean(ratio == 0) == pytest.approx(0.5, abs=4 * 0.5 / len(ratio) ** 0.5)
    goes_on = ratio[ratio != 0]
    assert -0.2 <= goes_on.min() < -0.19 and -0.01 < goes_on.max() < 0
    assert [notice.topic for notice in traced.notices] == ["drift"]
    assert not closed.traced.notices


def test_only_a_limit_that_is_lowest_at_the_end_may_fall_further() -> None:
    assert _further(np.array([3.0, 2.0, 1.5])) == pytest.approx(np.log(2.0))
    assert _further(np.array([1.5, 2.0, 3.0])) == _further(np.array([3.0, 1.0, 2.0])) == 0
    assert _further(np.array([3.0, 2.0, 0.0])) == 0, "unstable at the end however soft"


def test_the_fall_is_that_of_a_ramp_from_the_middle_of_a_part_to_its_end() -> None:
    centres = np.array([1, 3, 5]) / 6
    for slope in (0.4, -0.4):
        limits = 100 * np.exp(slope * centres)
        ends = 100 * np.exp(slope * np.array([0.0, 1.0]))
        assert _fall(limits, ends) == pytest.approx(np.log(limits.min() / ends.min()))
        assert _fall(limits, limits) == pytest.approx(np.log(limits.min() / ends.min()))
    assert _fall(np.array([3.0, 1.0, 2.0]), np.array([4.0, 2.0])) == 0, "nothing goes on"


def test_a_grip_that_gets_firmer_is_limited_by_its_end_where_another_crossing_binds() -> None:
    """Grips rise by 2.6 over the recording: part by part the limit rises, at the end it is less."""
    model = build_model("grasped", "phantom")
    at = np.array([0.0, 1.0, 3.0, 5.0, 6.0]) / 6
    grip = np.isin(model.names, ("kh", "bh", "ks", "bs"))
    course = model.values * np.where(grip, 2.64 ** at[:, None], 1.0)
    course[:, model.names.index("b2")] = 0.0
    limits = critical_stiffness(model, course).samples
    assert limits[1] < limits[2] < limits[3] and limits[4] < limits[0]
    ends = critical_stiffness(model, _ends(course[1:4])).samples
    assert ends == pytest.approx(limits[[0, 4]], rel=1e-6)
    assert _fall(limits[1:4], ends) == pytest.approx(np.log(limits[1] / limits[4]))
    lost = course[1:4] * np.where(np.array(model.names) == "bs", [[1e-4], [1.0], [1e4]], 1.0)
    assert _ends(lost)[:, model.names.index("bs")] == pytest.approx(
        lost[[0, 2], model.names.index("bs")]
    )


def test_a_drift_needs_three_parts_as_long_as_recordings_are() -> None:
    recording = read_recording(Path(__file__).parents[2] / "data/recordings/phantom-free.csv.gz")
    for seconds, there in ((7.4, False), (7.6, True)):
        etfe = estimate_etfe(recording.part(0, round(seconds / recording.period_s)))
        state = State(etfe, least_squares(build_model("free", "phantom"), etfe))
        assert bool(drift_trials(state, Meter())) == there


def test_the_rest_of_an_effect_is_its_share_of_what_the_effect_did() -> None:
    closed = fake_closed("explained", "nonlinear")
    fit = closed.analysis.fit
    base = too_damped(fit)
    moved = np.log(limit_of(base) / limit_of(fit))
    left = replace(
        with_effects(closed.traced, limit_log_sd=0.0),
        verdict="unexplained",
        before=_tests(90.0, "nonlinear"),
        after=_tests(45.0, "nonlinear"),
    )
    ratio = log_ratios(closed, left, base)
    width = 0.5 * abs(moved)
    assert width > 0.12, "the least widening would hide it"
    assert np.abs(ratio).max() <= width
    # Uniform either way: 90 % lie within 0.9 of it (3200 draws: to 0.01 of the width).
    assert np.quantile(ratio, [0.05, 0.95]) == pytest.approx([-0.9 * width, 0.9 * width], rel=0.05)


def test_a_law_that_leaves_what_would_pass_for_noise_is_not_quite_right_either() -> None:
    closed = fake_closed("explained", "nonlinear")
    fit = closed.analysis.fit
    base = too_damped(fit)
    found = replace(
        with_effects(closed.traced, limit_log_sd=0.0),
        before=_tests(90.0, "nonlinear"),
        after=_tests(3.0, "nonlinear"),
    )
    ratio = log_ratios(closed, found, base)
    assert 0 < np.abs(ratio).max() <= abs(np.log(limit_of(base) / limit_of(fit))) / 30


@pytest.mark.parametrize(
    "before, after, share",
    [(90.0, 45.0, 0.5), (90.0, 120.0, 1.0), (90.0, -np.inf, 0.0), (0.0, 5.0, 1.0)],
)
def test_what_is_left_is_a_share(before: float, after: float, share: float) -> None:
    """A test far below its threshold is below zero after an effect: nothing is left."""
    traced = fake_closed("explained", "nonlinear").traced
    traced = replace(traced, before=_tests(before, "nonlinear"), after=_tests(after, "nonlinear"))
    assert share_left(traced, "nonlinear") == share


def in_a_loop(before: float, after: float, family: str = "linear") -> Closed:
    """Dry friction was taken off, and a test of `family` still sees something."""
    closed = fake_closed("explained", "nonlinear")
    kinds = _tests(0.0)
    traced = replace(
        with_effects(closed.traced, limit_log_sd=0.0),
        verdict="unexplained",
        before=tuple(replace(test, statistic=before) for test in kinds),
        after=tuple(replace(t, statistic=after * (t.family == family)) for t in kinds),
    )
    return replace(closed, traced=traced)


def test_what_friction_leaves_in_a_loop_widens_the_limit_by_its_share(monkeypatch) -> None:
    """Windows that feedback biases do not show how the response deviates."""
    closed = in_a_loop(100.0, 20.0)
    fit = closed.analysis.fit
    base = too_damped(fit)
    monkeypatch.setattr(Etfe, "direct", True)
    ratio = log_ratios(closed, closed.traced, base)
    width = 0.2 * abs(np.log(limit_of(base) / limit_of(fit)))
    assert np.abs(ratio).max() <= width
    assert np.quantile(ratio, [0.05, 0.95]) == pytest.approx([-0.9 * width, 0.9 * width], rel=0.05)


@pytest.mark.parametrize("usual, widened", [(12.0, True), (None, False)])
def test_what_a_raised_threshold_lets_pass_in_a_loop_widens_all_the_same(
    monkeypatch, usual, widened
) -> None:
    """Half of the friction in a hand was found, and the limit lay above the truth by 2 %."""
    closed = in_a_loop(100.0, 15.0)
    after = tuple(replace(t, threshold=18.0, usual=usual) for t in closed.traced.after)
    traced = replace(closed.traced, verdict="explained", after=after)
    base = too_damped(closed.analysis.fit)
    monkeypatch.setattr(Etfe, "direct", True)
    assert bool(np.abs(log_ratios(closed, traced, base)).max() > 1e-3) == widened


def freed(traced: Traced) -> Traced:
    """Of a device that nobody holds."""
    fit = SimpleNamespace(model=build_model("free", "lhifam"))
    return replace(traced, state=replace(traced.state, fit=fit))


def test_a_small_rest_of_friction_may_stay() -> None:
    threshold = in_a_loop(100.0, 20.0).traced.after[0].threshold
    seen = 12 * threshold
    small = freed(in_a_loop(seen, 2 * threshold).traced)
    assert _leaves_little(small)
    too_far, too_large = in_a_loop(seen, 4 * threshold), in_a_loop(4 * threshold, 2 * threshold)
    for closed in (too_far, too_large, in_a_loop(seen, 2 * threshold, "nonlinear")):
        assert not _leaves_little(freed(closed.traced))
    state = replace(small.state, accepted=2 * small.state.accepted)
    assert not _leaves_little(replace(small, state=state))


def test_in_a_hand_no_rest_of_friction_stays() -> None:
    """A hand makes up for friction that is a little too small: 1.08 of a limit was recommended."""
    threshold = in_a_loop(100.0, 20.0).traced.after[0].threshold
    assert not _leaves_little(in_a_loop(12 * threshold, 2 * threshold).traced)


def test_where_nothing_was_found_the_limit_falls_and_its_upper_end_stays() -> None:
    closed = fake_closed("unexplained", "nonlinear")
    one = closed.analysis
    wide = with_discrepancy(one.limit, one.posterior, one.fit, closed.traced)
    before, after = (limit.quantile(np.array([0.05, 0.95])) for limit in (one.limit, wide))
    assert np.log(after[0] / before[0]) < -0.1
    # A little above, by a quarter of the least way down (0.12) at most and some sampling noise.
    assert 0 < np.log(after[1] / before[1]) < 0.04


def test_a_force_that_gained_a_little_may_be_what_is_left() -> None:
    """The limit falls to where the device would be with it."""
    closed = fake_closed("unexplained", "nonlinear")
    one, fit = closed.analysis, closed.analysis.fit
    theta = fit.theta.copy()
    for name in ("b1", "bc", "b2"):
        theta[fit.model.names.index(name)] *= 0.4
    less = replace(fit, theta=theta)
    force = Accepted("dead_zone", "dead zone", "nonlinear", "")
    near = Trial(force, replace(closed.traced.state, fit=less), 9.0, 4.0, 1)
    farther = replace(closed.traced, rejected=(near,))
    low, there = (
        np.quantile(np.log(wide.samples / one.limit.samples), 0.05)
        for wide in (
            with_discrepancy(one.limit, one.posterior, fit, traced)
            for traced in (closed.traced, farther)
        )
    )
    reach = float(np.log(limit_of(less) / limit_of(fit)))
    assert reach < low and there < 0.8 * reach


def test_the_end_of_a_gains_course_is_known_as_its_neighbours_agree() -> None:
    rng = np.random.default_rng(1)
    ramp = np.linspace(1.0, 0.85, 10)
    assert _edge_error(ramp) == pytest.approx(0.0, abs=1e-12)
    courses = ramp + 0.01 * rng.standard_normal((4000, 10))
    ends = 1.5 * courses[:, 0] - 0.5 * courses[:, 1]
    found = np.sqrt(np.mean([_edge_error(course) ** 2 for course in courses]))
    # 4000 courses know either standard deviation to 1.1 %.
    assert found == pytest.approx(ends.std(), rel=0.05)


def test_a_crossing_is_named_where_it_binds() -> None:
    """A measured arm's page said 0.273 Hz in one table and 20 Hz in the other."""
    known = BindingCrossing("rigid body at 0.273 Hz", 0.273, 0.98)
    far = BindingCrossing("rigid body at 19.9 Hz", 19.9, 0.4)
    near = BindingCrossing("rigid body at 0.3 Hz", 0.3, 0.3)
    nearer = BindingCrossing("rigid body at 0.27 Hz", 0.27, 0.2)
    other = BindingCrossing("vibration mode at 0.3 Hz", 0.3, 0.1)
    crossings, group = as_known((far, near, nearer, other), np.arange(4), (known,))
    assert crossings == (far, replace(known, probability=0.5), other)
    assert group.tolist() == [0, 1, 1, 2]
    closed = fake_closed("unexplained", "linear")
    one = closed.analysis
    wide = with_discrepancy(one.limit, one.posterior, one.fit, closed.traced)
    for number, found in enumerate(wide.crossings):
        bound = wide.frequency_hz[wide.group == number]
        assert len(bound) > 0
        assert found.probability == pytest.approx(len(bound) / len(wide.samples))
        assert found.frequency_hz == pytest.approx(np.median(bound), rel=0.25)


def test_a_crossing_on_a_grid_is_where_the_response_crosses():
    """It was at the grid's line before, beside a table that had another frequency for it."""
    model = rigid("lhifam")
    exact = critical_stiffness(model)
    grid = np.geomspace(0.05, 500.0, 1500)
    stiffness, place = _lowest_crossing(model.response(model.values[None], grid), grid)
    near = (grid[1] / grid[0] - 1) ** 2  # what a line between two points of a smooth curve is off
    assert stiffness == pytest.approx([exact.value], rel=near)
    assert place == pytest.approx([exact.crossings[0].frequency_hz], rel=near)


def test_crossings_of_a_bent_response_are_told_apart_by_their_frequency(monkeypatch) -> None:
    """A page named one crossing at 79 Hz, with 100 %, and had 21 Hz for its 5 % quantile."""
    closed = fake_closed("unexplained", "linear")
    one, rng = closed.analysis, np.random.default_rng(0)

    def bent(g: np.ndarray, frequency: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        low = rng.random(len(g)) < 0.3
        return np.where(low, 15e3, 22e3), np.where(low, 8.0, 103.0) * rng.uniform(0.99, 1.01)

    monkeypatch.setattr("bayeshaptic.diagnosis.widening.discrepancy._lowest_crossing", bent)
    wide = with_discrepancy(one.limit, one.posterior, one.fit, closed.traced)
    first, second = wide.crossings
    assert first == replace(one.limit.crossings[0], probability=first.probability)
    assert second.label.startswith("rigid body at") and second.frequency_hz < 9
    assert second.probability == pytest.approx(0.3, abs=0.05)
    assert np.all(wide.frequency_hz[wide.group == 1] < 9)


def test_lines_of_one_place_are_one_in_what_a_deviation_may_be():
    """Thousands of lines take their cube; sizes and lengths are as probable as with all of them."""
    rng = np.random.default_rng(8)
    log_f = np.sort(rng.uniform(0.0, 1.5, 600))
    own = 0.05**2 * matern(log_f[:, None] - log_f[None, :], 0.4)
    normal = rng.standard_normal((2, 2, len(log_f)))
    noise = 0.02 * rng.uniform(0.5, 2.0, len(log_f))
    smooth = np.linalg.cholesky(own + 1e-12 * np.eye(len(log_f))) @ (
        normal[0, 0] + 1j * normal[0, 1]
    )
    value = (smooth + noise * (normal[1, 0] + 1j * normal[1, 1])) / np.sqrt(2)
    found = Deviation(log_f, value, noise**2)
    few, _ = merged(found)
    assert len(few.log_f) < 160
    at = np.full(len(log_f), 1.0)  # told apart by less than a hundredth of a decade
    alike, _ = merged(replace(found, log_f=at))
    assert len(alike.log_f) == 1 and alike.variance == pytest.approx(1 / np.sum(1 / noise**2))
    cases, weight = evidence(found)
    plain = []
    for size, length in cases:
        root = np.linalg.cholesky(
            size**2 * matern(log_f[:, None] - log_f[None, :], length) + np.diag(noise**2)
        )
        white = np.linalg.solve(root, value)
        plain.append(-np.sum(np.abs(white) ** 2) - 2 * np.log(np.diag(root)).sum())
    exact = np.exp(np.array(plain) - max(plain))
    # The same cases hold nearly all; within a place the process changes by a hundredth of its size.
    assert np.abs(weight - exact / exact.sum()).sum() < 0.1
