"""The whole loop on one short recording of every family of effects (periodic: test_measured)."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from on_the_bench import recorded_on, usual_noise
from scipy.signal import chirp

from bayeshaptic.diagnosis import loop as closing, state as states
from bayeshaptic.diagnosis.loop import Loop, trace
from bayeshaptic.diagnosis.residuals.residual import Test as ResidualTest, smooth_columns
from bayeshaptic.diagnosis.state import Accepted, State, Trial, compared_errors, held_out_rms
from bayeshaptic.diagnosis.traced import Traced
from bayeshaptic.diagnosis.trials import linear, windows
from bayeshaptic.effects.laws import BESIDE
from bayeshaptic.effects.nonlinear.shapes import EXCESS_NOISE
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import Fit, runs_away, summarise, weighted_residuals
from bayeshaptic.inference.least_squares import least_squares, polish
from bayeshaptic.models import build_model
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.rig import Bench
from bayeshaptic.rig.effects.nonlinear import Drag
from bayeshaptic.rig.excitation import Prescribed
from bayeshaptic.stability import critical_stiffness

Effects = tuple[tuple[str, tuple[tuple[str, Any], ...]], ...]


@cache
def fitted(held: bool, seconds: float, effects: Effects) -> tuple[Bench, Etfe, Fit]:
    """A recording of the LHIfAM with effects, and the fit of the device as declared."""
    bench = Bench.from_device("lhifam", held=held)
    for name, fields in effects:
        bench = bench.with_effect(name, **dict(fields))
    etfe = estimate_etfe(recorded_on(bench, usual_noise(bench, seconds), seed=8))
    return bench, etfe, least_squares(build_model("grasped" if held else "free", "lhifam"), etfe)


def test_two_forces_in_the_place_of_one_are_accepted_together() -> None:
    def state(*titles: str) -> Any:
        return SimpleNamespace(accepted=tuple(SimpleNamespace(title=title) for title in titles))

    both: Any = SimpleNamespace(state=state("a mode", "friction", "drag"))
    assert closing._came_with(both, state("a mode")) == {"friction"}
    assert closing._came_with(both, state("a mode", "friction")) == set()


def test_candidates_begin_afresh_only_while_nothing_explains(monkeypatch) -> None:
    """Starting points that no fit has bent are for where the way from the present fit is barred."""
    _, etfe, fit = fitted(False, 8.0, MODE)
    calls: list[str] = []

    def watched(name: str) -> Any:
        own = getattr(linear, name)

        def fits(*given: Any) -> Any:
            calls.append(name)
            return own(*given)

        return fits

    for name in ("refine", "anew"):
        monkeypatch.setattr(linear, name, watched(name))
    linear.linear_trials(State(etfe, fit), Meter())
    followed = calls.count("refine") - 1  # the first is of the model without an effect
    assert followed > 1
    assert "anew" not in calls
    calls.clear()
    monkeypatch.setattr(linear.Sight, "explains", False)
    linear.linear_trials(State(etfe, fit), Meter())
    assert calls == ["refine"] * (1 + followed) + ["anew"] * followed


def test_at_first_sight_more_noise_is_no_sign_of_a_force(monkeypatch) -> None:
    """A hand is noise, too: without patience no force is simulated for it while a mode lacks."""
    _, etfe, fit = fitted(False, 8.0, MODE)
    tried: list[str] = []

    def noted(name: str) -> Any:
        return lambda *_: tried.append(name) or []

    for name in ("linear_trials", "nonlinear_trials"):
        monkeypatch.setattr(windows, name, noted(name))
    state = State(etfe, fit)
    trials = windows.WindowTrials(state)
    mode, noise, drag = (
        ResidualTest(name, family, 99.0, 5.0, None, "")
        for name, family in (
            ("bands", "linear"),
            (EXCESS_NOISE, "nonlinear"),
            ("v|v|", "nonlinear"),
        )
    )

    def classes(tests: tuple[ResidualTest, ...], patient: bool) -> list[str]:
        tried.clear()
        trials.trials(state, tests, Meter(), patient)
        return list(tried)

    both = ["linear_trials", "nonlinear_trials"]
    assert classes((mode, noise), True) == both
    assert classes((mode, noise), False) == ["linear_trials"]
    assert classes((mode, noise, drag), False) == both
    assert classes((noise,), False) == ["nonlinear_trials"]


def test_first_sight_tells_what_a_mode_explains_and_is_taken_once(monkeypatch) -> None:
    _, etfe, fit = fitted(False, 8.0, MODE)
    sieved: list[str] = []
    own = linear.sieve
    monkeypatch.setattr(linear, "sieve", lambda *given: sieved.append("") or own(*given))
    loop = Loop(etfe, fit, 40.0)
    assert loop.glance() is True
    loop.go_on()
    assert [effect.name for effect in loop.state.accepted] == ["second_mode"]
    assert len(sieved) == 1


def one(name: str, **fields: Any) -> Effects:
    return ((name, tuple(fields.items())),)


MODE = one("second_mode", frequency_hz=110.0, mass_ratio=0.1, damping_ratio=0.02)
FAMILIES = [
    ("linear", "second_mode", False, 8.0, MODE),
    ("nonlinear", "coulomb_friction", False, 10.0, one("coulomb_friction", force=0.5)),
    ("time-varying", "grip_drift", True, 16.0, one("grip_drift")),
    ("measurement", "mains_tone", False, 8.0, one("mains_tone", amplitude=5e-5)),
]


@pytest.mark.parametrize(
    ("family", "raised"), [("nonlinear", False), ("measurement", False), ("linear", True)]
)
def test_what_was_part_of_the_noise_is_judged_by_that_noise(family: str, raised: bool) -> None:
    """The same misfit beside a hundredth of the noise: ten times as many noises, and no worse."""
    _, etfe, fit = fitted(False, 8.0, MODE)
    quiet = replace(fit.windows, scatter=fit.windows.scatter / 100)
    accepted = Accepted("some", "some", family, "")
    before, after = (
        State(etfe, fit),
        State(etfe, summarise(fit.model, quiet, fit.theta), (accepted,)),
    )
    was, now = compared_errors(before, after)
    assert bool(np.any(now > 5 * was)) == raised
    assert raised or np.allclose(now, was, rtol=0.02)


def test_errors_of_a_state_are_those_of_every_candidate_beside_it(monkeypatch) -> None:
    """They take a fit, and were asked for once a candidate."""
    _, etfe, fit = fitted(False, 8.0, MODE)
    before, accepted = State(etfe, fit), Accepted("some", "some", "linear", "")
    asked = []
    monkeypatch.setattr(states, "held_out_rms", lambda one, part: asked.append(one) or 1.0)
    for after in (State(etfe, replace(fit), (accepted,)) for _ in range(3)):
        assert compared_errors(before, after)[0][0] == 1.0
    assert sum(one is fit for one in asked) == 1 and len(asked) == 4


def test_a_fit_to_what_the_noise_hid_is_no_error_of_what_was_mended() -> None:
    """Where the noise went, the fit follows; beside the noise that was there it need not."""
    _, etfe, fit = fitted(False, 8.0, MODE)
    beside_the_mode = np.abs(fit.windows.frequency_hz.mean(axis=1) - 110) < 20
    fell = np.where(beside_the_mode, 1e-6, 1.0)
    quiet = replace(fit.windows, scatter=fit.windows.scatter * fell)
    bent = summarise(fit.model, quiet, polish(fit.model, quiet, fit.theta))
    mended = State(etfe, bent, (Accepted("held_samples", "some", "measurement", ""),))
    as_noisy = summarise(fit.model, fit.windows, bent.theta)
    assert as_noisy.reduced_chi_square > 1.2 * fit.reduced_chi_square
    was, now = compared_errors(State(etfe, fit), mended)
    assert np.allclose(now, was, rtol=0.02)


def test_forces_come_after_a_linear_effect_that_leaves_noise_at_first_sight(monkeypatch) -> None:
    _, etfe, fit = fitted(False, 8.0, MODE)
    state, looked = State(etfe, fit), []
    monkeypatch.setattr(windows, "nonlinear_trials", lambda *_: looked.append("") or [])
    force = ResidualTest("sign(v)", "nonlinear", 99.0, 5.0, None, "")

    def forces(linear: float) -> int:
        looked.clear()
        tests = (ResidualTest("bands", "linear", linear, 5.0, None, ""), force)
        found = windows.WindowTrials(state).trials(state, tests, Meter())
        assert "second_mode" in {trial.name for trial in found}
        return len(looked)

    assert forces(99.0) == 0
    assert forces(10.0) == 1  # a force bends the response by as much
    monkeypatch.setattr(linear.Sight, "explains", False)  # nothing linear leaves noise
    assert forces(99.0) == 1


@pytest.mark.parametrize(
    ("family", "name", "held", "seconds", "effects"), FAMILIES, ids=[f[0] for f in FAMILIES]
)
def test_one_effect_is_named_and_the_limit_is_that_of_the_device(
    family: str, name: str, held: bool, seconds: float, effects: Effects
) -> None:
    bench, etfe, fit = fitted(held, seconds, effects)
    said: list[tuple[float, str]] = []
    found = trace(etfe, fit, lambda share, word: said.append((share, word)))
    assert (found.verdict, found.residual_class) == ("explained", family)
    assert [effect.name for effect in found.state.accepted] == [name]
    assert held_out_rms(found.state.fit) < 1.2 * max(held_out_rms(fit), 1.0)
    assert len(found.path) == 2 and found.skipped == ()
    shares = [share for share, _ in said]
    assert shares == sorted(shares) and all(0 <= share <= 1 for share in shares)
    if family != "time-varying":  # there the worst part counts
        limit = critical_stiffness(found.state.model, found.state.fit.theta).value
        # 8 and 10 s know the limit to some per cent; without the effect it is 1 to 10 dB off.
        assert abs(20 * np.log10(limit / bench.true_critical_stiffness())) < 0.6


def test_nothing_is_found_where_nothing_is() -> None:
    _, etfe, fit = fitted(False, 8.0, ())
    found = trace(etfe, fit)
    assert found.verdict == "consistent" and found.candidates == () and found.path == (found.state,)


def modes() -> tuple[Bench, Etfe, Fit]:
    two = one("second_mode", frequency_hz=60.0, mass_ratio=0.1, damping_ratio=0.03, on="m2")
    return fitted(False, 8.0, (*MODE, *two))


@cache
def two_modes() -> Traced:
    _, etfe, fit = modes()
    return trace(etfe, fit)


def test_two_modes_are_two_second_modes() -> None:
    found = two_modes()
    assert [effect.name for effect in found.state.accepted] == ["second_mode", "second_mode"]
    values = dict(zip(found.state.model.names, found.state.fit.theta, strict=True))
    hertz = sorted([values["mode_hz"], values["mode_hz_2"]])
    assert hertz == pytest.approx([60.0, 110.0], rel=0.01)
    assert found.verdict == "explained"


def test_a_mass_does_not_stand_in_for_the_ground() -> None:
    """Of a device without a file the transmission becomes the spring, its far mass the ground."""
    bench = Bench.from_device("phantom", held=False).with_effect("centring_stiffness")
    etfe = estimate_etfe(recorded_on(bench, usual_noise(bench, 10.0), seed=8))
    fit = least_squares(build_model("free", delay_s=bench.delay_s), etfe)
    assert fit.impossible == ("m2",)
    found = trace(etfe, fit)
    assert (found.verdict, [e.name for e in found.state.accepted]) == (
        "explained",
        ["centring_stiffness"],
    )
    known = dict(zip(found.state.model.names, found.state.fit.theta, strict=True))
    assert known["m2"] == pytest.approx(bench.values["m2"], rel=0.05)
    assert not found.state.fit.impossible


@pytest.mark.parametrize(
    "ends, away", [((), False), (("m2",), True), (("m2", "delay_s"), False), (("delay_s",), False)]
)
def test_a_delay_at_its_bound_is_not_explained_away(ends: tuple[str, ...], away: bool) -> None:
    """Force and position are not of one sample then: another fit would hide it."""
    assert runs_away(ends) == away


def test_what_a_budget_does_not_allow_is_said() -> None:
    _, etfe, fit = modes()
    found = trace(etfe, fit, budget_s=0.0)
    assert found.verdict == "unexplained" and found.state.accepted == ()
    assert "second vibration mode" in found.skipped


def test_a_smooth_change_of_the_response_is_seen_whole() -> None:
    """A phase that turns with the frequency, far above the noise: nothing else is in the residual.

    The model's own parameters explain a part of it, which is projected out.
    """
    _, _, fit = fitted(False, 8.0, ())
    windows, hertz = fit.windows, fit.windows.frequency_hz
    change = 1j * np.sin(6 * np.log10(hertz)) * fit.response(hertz.ravel()).reshape(hertz.shape)
    target = windows.target + np.einsum("wij,wj->wi", windows.design, change)
    moved = summarise(fit.model, replace(windows, target=target), fit.theta)
    columns, residual, _ = smooth_columns(moved)
    found = columns.T @ residual
    own = np.linalg.qr(slope_of(moved))[0].T @ residual
    assert found @ found + own @ own > 0.95 * residual @ residual


def slope_of(fit: Fit) -> np.ndarray:
    """Slopes of the residuals over the parameters."""
    here = coordinates(fit.model)
    phi = here.coordinate(fit.theta[None])
    return np.asarray(jacobian(weighted_residuals(fit.likelihood, here), phi)[0])


def test_a_drag_under_sweeps_is_no_other_linear_device() -> None:
    """Each frequency comes at one speed, so that tests of the residual see no force.

    A second mode was what it was taken for, with a limit 1.47 times too high.
    """
    bench = Bench.from_device("phantom", held=False)
    time = np.arange(12_000) * bench.period_s
    force = bench.force_rms * 2**0.5 * chirp(time % 2.0137, 0.5, 2.0137, 200.0)
    recording = recorded_on(bench.with_effect(Drag(0.001, "m1")), Prescribed(tuple(force)), seed=3)
    etfe = estimate_etfe(recording, (1.75, 200.0))  # the whole sweep
    traced = trace(etfe, least_squares(build_model("free", "phantom"), etfe))
    assert not any(t.flagged for t in traced.before if t.family == "nonlinear" and _of_shapes(t))
    found = next(effect for effect in traced.state.accepted if effect.name == "drag")
    # To two standard deviations of 3 %.
    assert found.estimates["drag_coefficient"].mean == pytest.approx(0.001, rel=0.06)
    assert [c.name for c in traced.candidates if c.taken_out][0] == "second_mode"
    limit = critical_stiffness(traced.state.model, traced.state.fit.theta).value
    # A delay of 0.03 of a period joins it, as rounding is no white noise under sweeps: 5 % too low.
    assert 0.94 < limit / bench.true_critical_stiffness() < 1.02


class NothingConvinces:
    """Trials of a state that a linear test and one for another force are raised by, in vain."""

    def __init__(self, first: State) -> None:
        self.first, self.asked = first, []

    def tests(self, state: State) -> tuple[ResidualTest, ...]:
        return (ResidualTest("smooth change", "linear", 6.0, 5.0, None, ""),)

    def mended(self, state: State) -> State:
        return state

    def trials(self, state: State, tests: tuple[ResidualTest, ...], *rest: Any) -> list[Trial]:
        self.asked.append({test.name for test in tests})
        return []

    def beside(self, state: State) -> tuple[ResidualTest, ...]:
        return (
            ResidualTest("velocity beside", "nonlinear", 8.0, 4.4, None, ""),
            ResidualTest("position beside", "nonlinear", 2.0, 4.4, None, ""),
        )


def test_a_force_that_is_seen_and_that_no_law_explains_is_left() -> None:
    """Friction under a sweep had half of its limit's damping, and a limit 19 times too high."""
    _, etfe, fit = fitted(False, 5.0, ())
    kind: Any = NothingConvinces(State(etfe, fit))
    traced = trace(etfe, fit, trials=kind)
    assert kind.asked == [{"smooth change"}, {"velocity beside"}]
    assert [test.name for test in traced.after] == ["smooth change", "velocity beside"]
    assert traced.verdict == "unexplained" and all(test.flagged for test in traced.after)


def little_gained(state: State, name: str, family: Any, gain: float) -> Trial:
    effect = Accepted(name, name, family, "")
    return Trial(effect, replace(state, accepted=(effect,)), gain, gain, 1)


def test_a_force_that_gains_a_little_stays_among_what_it_may_be() -> None:
    """No law of the library may be the device's; what comes near says how far the limit may be."""
    _, etfe, fit = fitted(False, 5.0, ())

    class LittleGained(NothingConvinces):
        def trials(self, state: State, *_: Any) -> list[Trial]:
            return [
                little_gained(state, "dead_zone", "nonlinear", 3.0),
                little_gained(state, "lag", "linear", 3.0),
                little_gained(state, "drag", "nonlinear", 0.0),
            ]

    kind: Any = LittleGained(State(etfe, fit))
    traced = trace(etfe, fit, trials=kind)
    assert traced.verdict == "unexplained"
    assert [trial.name for trial in traced.rejected] == ["dead_zone"]
    assert not traced.rejected[0].convincing and traced.rejected[0].score > 0


def _of_shapes(test: ResidualTest) -> bool:
    return not test.name.endswith(BESIDE)
