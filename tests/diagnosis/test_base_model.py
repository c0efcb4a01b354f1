"""The base model is chosen knowing that it may lack something."""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from response_table import noisy_table

import bayeshaptic as bh
from bayeshaptic.diagnosis.base import best_base, loops_in_turn
from bayeshaptic.diagnosis.base.best_base import traced_from_best_base
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED
from bayeshaptic.inference import choose, criterion
from bayeshaptic.inference.choose import UNDECIDED, Choice
from bayeshaptic.inference.criterion import ScoredFit
from bayeshaptic.models.hand import from_a_hand
from bayeshaptic.numerics.spending import RATE, Meter, spend
from bayeshaptic.rig import Bench, WhiteNoise, critical_limit, simulate

SIZES = {"rigid": 2, "free": 6, "chain-2": 10, "grasped": 11}


def fit(name: str, chi_square: float, further: int = 0) -> Any:
    """A fit of 300 windows whose residual has this mean square."""
    return SimpleNamespace(
        model=SimpleNamespace(name=name, size=SIZES[name] + further, held=name == "grasped"),
        residual=np.full(300, np.sqrt(chi_square)),
        reduced_chi_square=chi_square,
        run_away=False,
    )


def traced(name: str, verdict: str, chi_square: float, *sizes: int, family: str = "linear") -> Any:
    """A loop that accepted effects with so many parameters each."""
    effects = tuple(
        SimpleNamespace(title="effect", estimates={}, family=family, size=size) for size in sizes
    )
    state = SimpleNamespace(fit=fit(name, chi_square, sum(sizes)), accepted=effects)
    return SimpleNamespace(verdict=verdict, state=state)


class FakeLoop:
    """One that takes as many rounds as it accepts effects, and one at least."""

    def __init__(
        self,
        loops: dict[str, Any],
        glances: dict[str, bool] | None,
        seen: list[str],
        etfe: Any,
        fitted: Any,
        budget_s: float,
        *_: Any,
        **__: Any,
    ) -> None:
        self.end, self.rounds = loops[fitted.model.name], 0
        self.meter = Meter(budget_s)
        self.fitted, self.name = fitted, fitted.model.name
        self.glances, self.seen = glances, seen

    @property
    def traced(self) -> Any:
        verdict = self.end.verdict if self.done else UNEXPLAINED
        return SimpleNamespace(verdict=verdict, state=self.end.state)

    @property
    def done(self) -> bool:
        return self.rounds >= max(len(self.end.state.accepted), 1)

    @property
    def misfits(self) -> bool:
        return not self.done or self.end.verdict == UNEXPLAINED

    @property
    def state(self) -> Any:
        effects = self.end.state.accepted[: self.rounds]
        size = self.fitted.model.size + sum(effect.size for effect in effects)
        own = SimpleNamespace(model=SimpleNamespace(size=size))
        return SimpleNamespace(fit=own, accepted=effects)

    def glance(self) -> bool | None:
        return (self.glances or {}).get(self.name)

    def go_on(self, patient: bool = True) -> None:
        at_length = patient or self.glances is None
        self.seen.append(self.name if at_length else f"{self.name}, at first sight")
        self.rounds += 1


def chosen_of(
    monkeypatch: pytest.MonkeyPatch,
    chosen: str,
    misfits: dict[str, float],
    loops: dict[str, Any],
    from_a_hand: float = 0.0,
    scores: dict[str, float] | None = None,
) -> tuple[str, list[str]]:
    """The base model in the end, and those that the loop was closed on."""
    best, rounds = rounds_of(monkeypatch, chosen, misfits, loops, from_a_hand, scores)
    return best, list(dict.fromkeys(rounds))


def rounds_of(
    monkeypatch: pytest.MonkeyPatch,
    chosen: str,
    misfits: dict[str, float],
    loops: dict[str, Any],
    from_a_hand: float = 0.0,
    scores: dict[str, float] | None = None,
    glances: dict[str, bool] | None = None,
) -> tuple[str, list[str]]:
    """The base model in the end, and whose rounds the loop went through.

    `glances` say of base models whether an effect explains everything at first sight; rounds
    without patience are then told apart.
    """
    seen: list[str] = []

    def deviance(of: Any, noise: float) -> tuple[float, float]:
        far = from_a_hand * of.model.held
        return 2 * np.sum(of.residual**2) / noise + far, far

    monkeypatch.setattr(loops_in_turn, "Loop", partial(FakeLoop, loops, glances, seen))
    monkeypatch.setattr(criterion, "deviance", deviance)
    monkeypatch.setattr(best_base, "replace", lambda old, **new: _changed(old, new))
    fits = {name: fit(name, value) for name, value in misfits.items()}
    score = dict.fromkeys(fits, 0.0) | (scores or {})
    scored = {name: ScoredFit(f, score[name], deviance(f, 1.0)[1]) for name, f in fits.items()}
    choice = Choice(fits[chosen], "", scored)
    begun: Any = SimpleNamespace(etfe=None, fit=fits[chosen], choice=choice)
    return traced_from_best_base(begun, Options())[0].fit.model.name, seen


def _changed(old: Any, new: dict[str, Any]) -> Any:
    return SimpleNamespace(**(vars(old) | new))


@pytest.mark.parametrize(
    ("loops", "best"),
    [
        # Both explain everything: the fewer parameters, effects included.
        ({"grasped": (EXPLAINED, 1.0, 3, 2), "free": (EXPLAINED, 1.0, 3)}, "free"),
        ({"grasped": (EXPLAINED, 1.0, 3), "free": (EXPLAINED, 1.0, 3, 3, 3)}, "grasped"),
        # An explanation comes before a better fit with a rest.
        ({"grasped": (UNEXPLAINED, 1.0, 3), "free": (EXPLAINED, 1.3, 3)}, "free"),
        # Neither: what leaves less.
        ({"grasped": (UNEXPLAINED, 40.0, 3), "free": (UNEXPLAINED, 90.0, 3)}, "grasped"),
    ],
)
def test_base_models_are_compared_with_their_effects(monkeypatch, loops, best) -> None:
    found = {name: traced(name, *of) for name, of in loops.items()}
    misfits = {"rigid": 2e5, "free": 1e4, "grasped": 1e3}
    assert chosen_of(monkeypatch, "grasped", misfits, found) == (best, ["grasped", "free"])


@pytest.mark.parametrize(
    ("chosen", "misfits", "own"),
    [
        ("free", {"free": 1.0, "grasped": 1.0}, (CONSISTENT, 1.0)),  # it fits
        (
            "free",
            {"free": 9.0, "grasped": 8.0},
            (EXPLAINED, 1.0, 2),
        ),  # one effect, and no simpler base
        ("grasped", {"grasped": 9.0}, (UNEXPLAINED, 3.0, 2)),  # the study says that it was held
    ],
)
def test_the_loop_is_closed_once_where_nothing_else_is_in_question(
    monkeypatch, chosen, misfits, own
) -> None:
    found = {chosen: traced(chosen, *own)}
    assert chosen_of(monkeypatch, chosen, misfits, found) == (chosen, [chosen])


def test_a_hand_that_is_like_none_is_compared_with_what_nobody_holds(monkeypatch) -> None:
    """It fits, but with a mass of tons: a free device with one effect more explains it, too."""
    found = {
        "grasped": traced("grasped", EXPLAINED, 1.0, 3),
        "free": traced("free", EXPLAINED, 1, 1),
    }
    misfits = {"free": 90.0, "grasped": 1.0}
    assert chosen_of(monkeypatch, "grasped", misfits, found, 4.0) == ("grasped", ["grasped"])
    assert chosen_of(monkeypatch, "grasped", misfits, found, 60.0) == ("free", ["grasped", "free"])


@pytest.mark.parametrize(
    ("behind", "own", "best"),
    [
        # A hand that hardly holds fits all but as well as a third mass: its motion is no noise.
        (6.2, UNEXPLAINED, "grasped"),
        (6.2, CONSISTENT, "chain-2"),  # nothing is left to ask
        (12.0, UNEXPLAINED, "chain-2"),  # no hand is like this
    ],
)
def test_what_a_chain_leaves_may_be_a_hand_that_hardly_holds(
    monkeypatch, behind, own, best
) -> None:
    found = {
        "chain-2": traced("chain-2", own, 1.0),
        "grasped": traced("grasped", CONSISTENT, 1.0),
    }
    misfits, scores = {"free": 200.0, "chain-2": 1.0, "grasped": 1.0}, {"grasped": behind}
    name, seen = chosen_of(monkeypatch, "chain-2", misfits, found, scores=scores)
    assert (name, seen) == (best, ["chain-2", "grasped"] if best == "grasped" else ["chain-2"])


@pytest.mark.parametrize(("family", "best"), [("nonlinear", "free"), ("linear", "grasped")])
def test_strong_friction_makes_a_free_device_look_held(monkeypatch, family, best) -> None:
    """A hand that fits was chosen before the friction was known; something is left of it."""
    found = {
        "grasped": traced("grasped", UNEXPLAINED, 1.0, 1, 3, family=family),
        "free": traced("free", EXPLAINED, 1.0, 1, family="nonlinear"),
    }
    misfits = {"free": 9.0, "grasped": 1.0}
    tried = ["grasped", "free"] if best == "free" else ["grasped"]
    scores = {"free": 50.0}
    assert chosen_of(monkeypatch, "grasped", misfits, found, scores=scores) == (best, tried)


@pytest.mark.parametrize(
    ("name", "rigid", "best"),
    [
        ("free", (EXPLAINED, 1.0, 1, 1, 2), "rigid"),
        ("chain-2", (EXPLAINED, 1.0, 1, 1, 2), "rigid"),
        ("free", (UNEXPLAINED, 30.0, 1), "free"),  # one mass does not explain it
    ],
)
def test_a_mass_that_runs_away_beside_what_was_found_is_the_ground(
    monkeypatch, name, rigid, best
) -> None:
    """One mass on a spring behind a filter and a lag, which the base models' own fits lack."""
    found = {
        name: traced(name, EXPLAINED, 1.0, 1, 2),
        "rigid": traced("rigid", *rigid),
    }
    misfits = {"rigid": 2e5, name: 1.2}
    assert chosen_of(monkeypatch, name, misfits, found) == (name, [name])
    found[name].state.fit.run_away = True
    assert chosen_of(monkeypatch, name, misfits, found) == (best, [name, "rigid"])


def test_no_hand_takes_for_its_own_motion_what_a_force_leaves(monkeypatch) -> None:
    """Backlash in a free device: a hand that the response does not show has noise enough."""
    found = {
        "free": traced("free", UNEXPLAINED, 1.0, 1, family="nonlinear"),
        "grasped": traced("grasped", CONSISTENT, 1.0),
    }
    misfits, scores = {"free": 1.0, "grasped": 1.0}, {"grasped": 50.0}
    assert chosen_of(monkeypatch, "free", misfits, found, scores=scores) == ("free", ["free"])


@pytest.mark.parametrize(
    ("verdict", "left", "best"),
    [
        # A dead zone of a free device: something of it is left, and a hand takes the rest up.
        (UNEXPLAINED, 1.1, "free"),
        (UNEXPLAINED, 3.0, "grasped"),  # without a hand the response is predicted worse
        (EXPLAINED, 1.1, "free"),
    ],
)
def test_a_hand_explains_nothing_that_a_free_device_predicts_better(
    monkeypatch, verdict, left, best
) -> None:
    found = {
        "grasped": traced("grasped", EXPLAINED, 1.5, 1, 1, family="nonlinear"),
        "free": traced("free", verdict, left, 1, family="nonlinear"),
    }
    misfits = {"free": 90.0, "grasped": 50.0}
    assert chosen_of(monkeypatch, "grasped", misfits, found)[0] == best


def test_what_was_given_up_takes_no_explanation_away(monkeypatch) -> None:
    monkeypatch.setattr(best_base, "criterion", lambda one, _: one.state.fit.reduced_chi_square)
    found = {
        "grasped": traced("grasped", EXPLAINED, 1.5, 1, 1),
        "free": traced("free", UNEXPLAINED, 1.0, 1),
    }
    assert best_base._best(found, 1.0, ()) == "free"
    assert best_base._best(found, 1.0, ("free",)) == "grasped"


@pytest.mark.parametrize(
    ("loops", "best"),
    [
        # A third mass with a spring is a hand: 10 and 2 parameters, 11 and 1.
        ({"chain-2": (1, 1), "grasped": (1,)}, "grasped"),
        # And one above the band takes up a drag: 10 and 1, 6 and 2.
        ({"chain-2": (1,), "free": (1, 1)}, "free"),
    ],
)
def test_of_base_models_that_explain_alike_the_one_with_fewest_parameters(
    monkeypatch, loops, best
) -> None:
    found = {name: traced(name, EXPLAINED, 1.0, *sizes) for name, sizes in loops.items()}
    found["free"] = found.get("free", traced("free", UNEXPLAINED, 9.0, 3))
    found["grasped"] = found.get("grasped", traced("grasped", UNEXPLAINED, 9.0, 3))
    monkeypatch.setattr(best_base, "criterion", lambda one, _: one.state.fit.reduced_chi_square)
    assert best_base._best(found, 1.0) == best


def test_what_would_need_no_fewer_parameters_than_what_explains_is_given_up(monkeypatch) -> None:
    """A chain that misfits is at 12 after a round, where a hand with one effect explains with 13.

    A free device is at 8 after one round, and goes on.
    """
    found = {
        "chain-2": traced("chain-2", EXPLAINED, 1.0, 1, 1),
        "grasped": traced("grasped", EXPLAINED, 1.0, 1),
        "free": traced("free", EXPLAINED, 1.0, 1, 1),
    }
    misfits = {"free": 200.0, "chain-2": 50.0, "grasped": 51.0}
    best, rounds = rounds_of(monkeypatch, "chain-2", misfits, found)
    assert (best, rounds) == ("free", ["chain-2", "grasped", "free", "free"])
    found["free"] = traced("free", EXPLAINED, 1.0, 4, 1)
    best, rounds = rounds_of(monkeypatch, "chain-2", misfits, found)
    assert (best, rounds) == ("grasped", ["chain-2", "grasped", "free"])


def test_what_explains_at_first_sight_goes_first_and_ends_all_long_ways(monkeypatch) -> None:
    """Where a hand with a lag explains everything, no other base model is searched at length."""
    found = {
        "chain-2": traced("chain-2", UNEXPLAINED, 40.0, 1),
        "grasped": traced("grasped", EXPLAINED, 1.0, 1),
        "free": traced("free", UNEXPLAINED, 40.0, 1, 3),
    }
    misfits = {"free": 2e4, "chain-2": 4900.0, "grasped": 5100.0}
    for seen, rounds in [
        (
            {"chain-2": False, "grasped": True},
            ["grasped", "chain-2, at first sight", *2 * ["free, at first sight"]],
        ),
        # No other base model is looked at before one that first sight tells nothing of.
        ({"grasped": True}, ["chain-2", "grasped", *2 * ["free, at first sight"]]),
        (
            {"chain-2": False, "grasped": False},
            ["chain-2", "grasped", *2 * ["free, at first sight"]],
        ),
    ]:
        best = rounds_of(monkeypatch, "chain-2", misfits, found, glances=seen)
        assert best == ("grasped", rounds)


def test_beside_a_chain_that_misfits_a_mode_may_be_on_the_motor(monkeypatch) -> None:
    """A free device with a mode on its motor is no chain, and a chain with a mode more fits it."""
    found = {name: traced(name, EXPLAINED, 1.0, 3) for name in ("chain-2", "grasped", "free")}
    misfits = {"free": 3e4, "chain-2": 3700.0, "grasped": 3900.0}
    tried = ["chain-2", "grasped", "free"]
    assert chosen_of(monkeypatch, "chain-2", misfits, found) == ("free", tried)


def test_a_chain_that_nothing_is_found_on_does_not_stand_alone(monkeypatch) -> None:
    """It leaves a little more than noise, and no test says what: the base of a free device."""
    found = {name: traced(name, EXPLAINED, 1.0, 3) for name in ("grasped", "free")}
    found["chain-2"] = traced("chain-2", UNEXPLAINED, 1.4)
    misfits = {"free": 460.0, "chain-2": 1.4, "grasped": 1.4}
    assert chosen_of(monkeypatch, "chain-2", misfits, found)[0] == "free"


def test_hands_are_near_what_hands_are_like() -> None:
    """Draws of a hand are some five squared standard deviations away, a spring to the frame far."""
    rng = np.random.default_rng(5)
    mass = 0.3 * np.exp(2.0 * rng.normal(size=4000))
    arm = 2 * np.pi * 3.0 * np.exp(0.8 * rng.normal(size=4000))
    grip = 2 * np.pi * 25.0 * np.exp(0.9 * rng.normal(size=4000))
    hand = {
        "mh": mass,
        "kh": mass * arm**2,
        "bh": 2 * 0.7 * np.exp(1.1 * rng.normal(size=4000)) * mass * arm,
        "ks": mass * grip**2,
        "bs": 2 * 0.1 * np.exp(1.5 * rng.normal(size=4000)) * mass * grip,
    }
    far = np.sum(from_a_hand(hand, 0.3) ** 2, axis=1)
    assert far.mean() == pytest.approx(5.0, abs=5 * np.sqrt(10 / 4000))
    frame = {"mh": 300.0, "kh": 1e4, "bh": 3.0, "ks": 12.0, "bs": 1e-3}
    assert np.sum(from_a_hand({k: np.array([v]) for k, v in frame.items()}, 0.3) ** 2) > 60


def test_a_third_mass_is_no_hand(tmp_path) -> None:
    """Three masses in a row that rub on the ground, nobody named: not taken for a held device."""
    model = bh.chain(2, delay_s=2e-4, period_s=1e-3)
    values = {"m1": 0.1, "b1": 0.3, "bc": 0.3, "kc": 3e3, "m2": 0.2, "b2": 0.0}
    values |= {"m3": 0.1, "c3": 0.3, "k3": 2e3, "b3": 0.5}
    theta = np.array([values[name] for name in model.names])
    frequency = np.geomspace(1.0, 200.0, 300)
    table = noisy_table(tmp_path, frequency, model.response(theta, frequency), 0.01, seed=3)
    choice = choose.choose_model(table, delay_s=2e-4)
    assert choice.fit.model.name == "chain-2"
    grasped = choice.candidates["grasped"]
    assert grasped.fit.reduced_chi_square < 1.2
    assert grasped.score > choice.candidates["chain-2"].score + UNDECIDED


@pytest.mark.parametrize("told", [{"delay_s": 1e-3, "held": False}, {}], ids=["told", "unknown"])
def test_one_mass_on_a_spring_is_a_joystick_with_no_second_mass_and_no_hand(told) -> None:
    """Its second mass would be the ground; and one mass in a hand explains it as well."""
    inertia, spring = 8e-4, 8e-4 * (2 * np.pi * 3) ** 2
    joystick = Bench(
        "rigid", {"m": inertia, "b": 3e-3}, 1e-3, 1e-3, "Nm", encoder_resolution=2 * np.pi / 16384
    ).with_effect("centring_stiffness", stiffness=spring)
    run = simulate(joystick, WhiteNoise(0.3, 300.0, 0.3, 10.0), seed=3)
    recording = bh.recording_from_arrays(**run.signals)
    found = bh.close_loop(recording, **told)
    assert found.analysis.posterior.converged
    assert found.analysis.model.name == "rigid"
    assert found.effect_names == ("centring_stiffness",)
    low, median, high = np.log(found.analysis.limit.quantile(np.array([0.05, 0.5, 0.95])))
    off = median - np.log(critical_limit(joystick).stiffness)
    assert abs(off) < 1.5 * (high - low)  # five standard deviations
    assert high - low < 0.05


def test_a_second_mass_that_may_as_well_be_the_ground_is_left_out() -> None:
    """It fits, with tons; and among them is a device that hardly anything but a wall holds."""
    stick = Bench("rigid", {"m": 0.2, "b": 3.7}, 1e-3, 5e-4, "N", encoder_resolution=1e-3)
    stick = stick.with_effect("centring_stiffness", stiffness=565.0)
    run = simulate(stick, WhiteNoise(25.0, 60.0, 0.3, 5.0), seed=1)
    found = bh.close_loop(bh.recording_from_arrays(**run.signals), hidden=False)
    assert found.analysis.model.name == "rigid"
    assert found.effect_names == ("centring_stiffness",)


def test_one_mass_in_a_hand_is_a_held_device(tmp_path) -> None:
    """No transmission shows: with one of its own it was taken for three masses in a row."""
    model = bh.grasped(delay_s=3e-4, period_s=1e-3)
    values = {"m1": 0.05, "b1": 0.1, "bc": 50.0, "kc": 1e8, "m2": 0.05, "b2": 0.1}
    values |= {"bs": 16.9, "ks": 3410.0, "mh": 0.185, "bh": 7.83, "kh": 82.3}
    theta = np.array([values[name] for name in model.names])
    frequency = np.geomspace(2.0, 200.0, 300)
    table = noisy_table(tmp_path, frequency, model.response(theta, frequency), 0.01, seed=3)
    choice = choose.choose_model(table, delay_s=3e-4)
    assert choice.fit.model.name == "grasped"
    assert choice.undecided == ()
    assert choice.candidates["grasped"].as_one_mass
    assert "one mass in a hand" in choice.reason


@pytest.mark.parametrize(("spent", "loops"), [(0.3, 3), (0.6, 2), (1.1, 1)])
def test_loops_that_are_closed_again_share_one_budget(monkeypatch, spent, loops) -> None:
    """What lies between the samples may change with every loop, and none is without an end."""
    budgets: list[float] = []

    def traced_from_best_base(begun: Any, options: Options) -> Any:
        budgets.append(options.budget_s)
        spend(spent * Options().budget_s * RATE)
        model = SimpleNamespace(effects=())
        return begun, SimpleNamespace(state=SimpleNamespace(model=model, fit=None))

    monkeypatch.setattr(best_base, "traced_from_best_base", traced_from_best_base)
    monkeypatch.setattr(best_base, "as_of_the_loop", lambda measured, fit: None)
    monkeypatch.setattr(best_base, "hardly_differ", lambda etfe, other: False)
    monkeypatch.setattr(best_base, "refitted", lambda begun, *rest: begun)
    begun: Any = SimpleNamespace(measured=None, etfe=None)
    best_base.traced_as_of_the_loop(begun, "auto", Options())
    left = [1 - number * spent for number in range(loops)]
    assert budgets == pytest.approx([Options().budget_s * share for share in left])
