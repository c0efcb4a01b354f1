"""What closing the loop accepts: its rules on tables of cases, without a recording."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.acceptance import (
    choose,
    excess,
    needless,
    raises_error,
    remaining,
    rivals_of,
    ties,
    verdict_of,
    with_misfit,
)
from bayeshaptic.diagnosis.residuals.residual import Test as ResidualTest
from bayeshaptic.diagnosis.state import Accepted, State, Trial, log_likelihoods
from bayeshaptic.effects.laws import fitted
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.shapes import Usual
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import rigid
from bayeshaptic.numerics.spending import Meter, metered, spend
from bayeshaptic.recordings.response.windows import Windows

NOWHERE: Any = SimpleNamespace(model=None, accepted=())


def trial(name: str, gain: float, family: str = "linear", size: int = 1, fit: float = 0) -> Trial:
    state: State = NOWHERE
    return Trial(Accepted(name, name, family, ""), state, fit or 2 * gain, gain, size)


def found(family: str, statistic: float, threshold: float = 4.0, name: str = "") -> ResidualTest:
    return ResidualTest(name or family, family, statistic, threshold, None, "")


def accepted(*families: str) -> list[Accepted]:
    return [Accepted(family, family, family, "") for family in families]


@pytest.mark.parametrize(
    ("gain_fit", "gain_choose", "size", "good"),
    [
        (20, 10, 1, True),
        (16, 8, 1, False),  # not more than enough
        (100, 14, 1, False),  # overfitted
        (100, 16, 1, True),
        (40, 15, 8, False),  # less than its parameters cost
        (40, 17, 8, True),
        (0, -5, 1, False),
        (5, 10, 1, False),  # less where it was fitted, to twice as many windows: chance
    ],
)
def test_convincing(gain_fit: float, gain_choose: float, size: int, good: bool) -> None:
    assert thresholds.convincing(gain_fit, gain_choose, size) is good


@pytest.mark.parametrize(
    ("trials", "left", "expected"),
    [
        ([], {}, None),
        ([trial("a", 5)], {}, None),
        ([trial("a", 50)], {}, "a"),
        # The better one leaves something, a rival does not.
        ([trial("a", 100), trial("b", 95)], {"a": 9.0, "b": 0.0}, "b"),
        # What is far behind is no rival, whatever it leaves.
        ([trial("a", 100), trial("b", 50)], {"a": 9.0, "b": 0.0}, "a"),
        # Alike on what they were not fitted to: the one that is worth more on all windows.
        ([trial("a", 100, size=3), trial("b", 95, size=1)], {"a": 0.0, "b": 0.0}, "b"),
        ([trial("b", 98, size=2), trial("a", 100, size=1)], {"a": 0.0, "b": 0.0}, "b"),
        # Of laws of a force the one with fewer parameters.
        (
            [trial("a", 100, "nonlinear", size=1), trial("b", 99, "nonlinear", size=2)],
            {"a": 0.0, "b": 0.0},
            "a",
        ),
        # Laws of a force may leave more by chance.
        (
            [trial("a", 100, "nonlinear"), trial("b", 92, "nonlinear")],
            {"a": 2.5, "b": 0.0},
            "a",
        ),
        ([trial("a", 100, "nonlinear"), trial("b", 90, "nonlinear")], {"a": 9.0, "b": 1.0}, "b"),
    ],
)
def test_choice(trials: list[Trial], left: dict[str, float], expected: str | None) -> None:
    chosen = choose(trials, lambda trial: left[trial.name], lambda trial: ord(trial.name))
    assert (chosen.name if chosen else None) == expected


def test_rivals_come_best_first_and_only_the_convincing() -> None:
    trials = [trial("b", 95), trial("a", 100), trial("c", 99, fit=1000), trial("d", 60)]
    assert [rival.name for rival in rivals_of(trials)] == ["a", "b"]


@pytest.mark.parametrize(
    ("first", "second", "tie"),
    [
        (trial("a", 100), trial("b", 95), True),
        (trial("a", 100), trial("b", 90), False),
        (trial("a", 100), trial("b", 99, "nonlinear"), False),
        (trial("a", 1000, "nonlinear"), trial("b", 960, "nonlinear"), True),
        (trial("a", 1000), trial("b", 960), False),
    ],
)
def test_ties(first: Trial, second: Trial, tie: bool) -> None:
    assert ties(first, second) is tie


@pytest.mark.parametrize(
    ("families", "test", "flagged"),
    [
        ((), found("linear", 4.5), True),
        (("linear",), found("linear", 4.5), True),
        # Something was taken off the recording: 1.5 times the threshold.
        (("nonlinear",), found("linear", 5.5), False),
        (("nonlinear",), found("linear", 6.5), True),
        (("nonlinear",), found("nonlinear", 5.5), False),
        (("nonlinear",), found("nonlinear", 19.0), True),
        (("measurement",), found("nonlinear", 19.0), True),
        # No news: a mended recording, the worst part of one that drifts.
        (("measurement",), found("measurement", 99.0), False),
        (("time-varying",), found("time-varying", 99.0), False),
        (("linear",), found("time-varying", 99.0), True),
    ],
)
def test_what_may_remain(families: tuple[str, ...], test: ResidualTest, flagged: bool) -> None:
    left = remaining([test], accepted(*families))
    assert any(test.flagged for test in left) is flagged


def test_positions_that_are_rounded_allow_for_nothing_more() -> None:
    """Dry friction, 5 sd, passed beside a coarse encoder, with a limit 4 % too high."""
    rounded = Accepted("quantisation", "quantisation", "measurement", "")
    tests = [found("nonlinear", 5.0), found("measurement", 99.0)]
    assert [test.flagged for test in remaining(tests, [rounded])] == [True]
    lost = replace(rounded, name="dropped_samples")
    assert not any(test.flagged for test in remaining(tests, [rounded, lost]))


@pytest.mark.parametrize(
    ("families", "tests", "expected"),
    [
        ((), [found("linear", 3.0)], ("consistent", None)),
        (("linear",), [found("linear", 3.0)], ("explained", "linear")),
        (("nonlinear", "linear"), [], ("explained", "nonlinear")),
        ((), [found("linear", 8.0), found("nonlinear", 12.0)], ("unexplained", "nonlinear")),
        (("linear",), [found("measurement", 5.0)], ("unexplained", "measurement")),
    ],
)
def test_verdict(
    families: tuple[str, ...], tests: list[ResidualTest], expected: tuple[str, str | None]
) -> None:
    assert verdict_of(accepted(*families), tests) == expected


@pytest.mark.parametrize(
    ("before", "after", "worse"),
    [
        (12.0, 106.0, True),  # a pause at the target that was taken for a clipped position
        (12.0, 1.0, False),
        (0.9, 1.15, False),  # both are noise
        (1.0, 1.3, True),
        (30.0, 33.0, False),  # noise that was taken off makes the same misfit a little larger
    ],
)
def test_no_explanation_may_raise_the_held_out_error(
    before: float, after: float, worse: bool
) -> None:
    assert raises_error(before, after) is worse


@pytest.mark.parametrize(("misfits", "verdict"), [(True, "unexplained"), (False, "explained")])
def test_what_is_explained_leaves_noise(misfits: bool, verdict: str) -> None:
    fit: Any = SimpleNamespace(reduced_chi_square=2.0, misfits=misfits)
    state: Any = SimpleNamespace(fit=fit, accepted=accepted("nonlinear"))
    tests = with_misfit((found("nonlinear", 5.0, 6.0),), state)  # allowed for, as a law's error
    assert verdict_of(state.accepted, tests)[0] == verdict


def test_a_drag_drives_no_motion() -> None:
    usual = Usual(velocity=1.0, position=1.0, x="m")
    shapes = [shape for _, shape in fitted(MOTOR, usual) if shape.name.startswith("drag")]
    assert shapes and all(shape.positive for shape in shapes)


def test_an_effect_that_is_worth_less_than_its_parameters_may_go() -> None:
    assert needless(3.0, 2) and needless(-1.0, 1) and not needless(5.0, 2)


def test_excess_counts_what_is_flagged() -> None:
    assert excess([found("linear", 8.0), found("linear", 3.9)]) == 2.0


def windows(misfit: float) -> tuple[Windows, Any]:
    """Forty windows of a rigid device whose target is off by so many standard deviations."""
    rng = np.random.default_rng(3)
    model = rigid(delay_s=0.0).with_period(1e-3)
    theta = np.array([0.1, 1.0])
    hertz = np.geomspace(2, 200, 120).reshape(40, 3)
    g = model.response(theta, hertz.ravel()).reshape(40, 3)
    design = np.broadcast_to(np.eye(3), (40, 3, 3)) / np.abs(g).mean(axis=1)[:, None, None]
    noise = rng.standard_normal((40, 3, 2)) @ np.array([1, 1j]) / np.sqrt(2)
    target = np.einsum("wij,wj->wi", design, g) + misfit * noise
    return Windows(hertz, design, target, np.full(40, 20.0), np.full(40, 24.0)), (model, theta)


def test_where_the_model_is_true_the_likelihood_is_the_plain_one() -> None:
    data, (model, theta) = windows(0.8)
    plain = Likelihood(model, data).pointwise(theta[None])[0]
    assert log_likelihoods(model, data, theta)[1] == pytest.approx(plain[1::4].sum())


def test_a_small_gain_beside_a_large_misfit_counts_for_little() -> None:
    """A thousandth of the misfit, in power: 30 complex numbers are judged, each of log 1.001."""
    data, (model, theta) = windows(100.0)
    less, _ = windows(100.0 * np.sqrt(0.999))
    gain = log_likelihoods(model, less, theta) - log_likelihoods(model, data, theta)
    assert gain[1] == pytest.approx(30 * 1e-3, rel=0.2)
    plain = [Likelihood(model, d).pointwise(theta[None])[0][1::4].sum() for d in (less, data)]
    assert plain[0] - plain[1] > 5 * gain[1]


def test_spending_is_counted_and_what_is_not_affordable_said() -> None:
    with metered(100) as meter:
        assert meter.affords("first")
        spend(150)
        assert not meter.affords("second") and not meter.affords("second")
    assert meter.spent == 150 and meter.skipped == ["second"]
    spend(1)  # outside nobody counts
    assert meter.spent == 150 and Meter().affords("anything")
