"""Which base model, in a closed loop where the chosen one leaves something."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.diagnosis.base import best_direct
from bayeshaptic.diagnosis.base.best_direct import traced_directly
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.residuals import residual
from bayeshaptic.diagnosis.state import Accepted, State, Trial
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED, Traced
from bayeshaptic.diagnosis.trials import direct
from bayeshaptic.diagnosis.trials.direct import trace_directly
from bayeshaptic.inference.choose import UNDECIDED, Choice
from bayeshaptic.inference.criterion import ScoredFit
from bayeshaptic.numerics.spending import Meter
from benchmarks.through_reference import make

SIZES = {"rigid": 3, "free": 7, "chain-2": 11, "grasped": 12}
FRICTION, BASE = "friction_force", "compliant base"


def fit(name: str) -> Any:
    return SimpleNamespace(
        model=SimpleNamespace(name=name, size=SIZES[name], held=name == "grasped")
    )


def ends(name: str, verdict: str, score: float, effect: str = "", limit: float = 1.0) -> Any:
    """How a loop on a base model ends."""
    found = (SimpleNamespace(title=effect, estimates={effect: 1.0}),) if effect else ()
    state = SimpleNamespace(fit=fit(name), accepted=found)
    return SimpleNamespace(verdict=verdict, state=state, score=score, limit=limit)


def outcome(
    monkeypatch: pytest.MonkeyPatch,
    chosen: str,
    *loops: Any,
    modelled: bool = True,
    rubbing: float | None = None,
    taken: list[str] | None = None,
    bare: dict[str, float] | None = None,
) -> tuple[str, Any, list[str]]:
    """Name of the base model in the end, its loop, and the base models that were tried.

    `rubbing` is the BIC of dry friction on others, where it convinces; `taken` gets those where
    that is taken, and `bare` are scores of base models that are not zero.
    """
    by_name, tried = {loop.state.fit.model.name: loop for loop in loops}, []
    took: list[str] = [] if taken is None else taken

    def traced(base: Any, meter: Any) -> Any:
        tried.append(base)
        return by_name[base]

    monkeypatch.setattr(best_direct, "untraced", lambda state: state.fit.model.name)
    monkeypatch.setattr(best_direct, "trace_directly", traced)
    monkeypatch.setattr(best_direct, "stands", lambda one: one.verdict != UNEXPLAINED)
    monkeypatch.setattr(best_direct, "criterion", lambda one, _: one.score)
    monkeypatch.setattr(best_direct, "_limit", lambda one: one.limit)
    monkeypatch.setattr(best_direct, "replace", _replaced)
    monkeypatch.setattr(best_direct, "base_of", lambda begun, name: (None, fit(name)))
    trial = SimpleNamespace(state=SimpleNamespace(fit=None)) if rubbing is not None else None
    monkeypatch.setattr(best_direct, "trial_of", lambda *_: trial)
    monkeypatch.setattr(best_direct, "information_criterion", lambda *_: rubbing)
    monkeypatch.setattr(
        best_direct, "with_trial", lambda other, _: (took.append(other), by_name[other])[1]
    )
    monkeypatch.setattr(best_direct, "State", lambda etfe, fit: SimpleNamespace(fit=fit))
    scores = bare or {}
    candidates = {name: ScoredFit(fit(name), scores.get(name, 0.0)) for name in SIZES}
    choice = Choice(fit(chosen), "", candidates) if modelled else None
    begun: Any = SimpleNamespace(etfe=None, fit=fit(chosen), choice=choice)
    begun, found = traced_directly(begun, Meter())
    return begun.fit.model.name, found, tried


def _replaced(one: Any, **changes: Any) -> Any:
    return SimpleNamespace(**{**vars(one), **changes})


def test_friction_that_passed_for_a_second_mode(monkeypatch) -> None:
    """Two masses and friction: a chain had left a little, with a limit of twice the truth."""
    name, found, tried = outcome(
        monkeypatch,
        "chain-2",
        ends("chain-2", UNEXPLAINED, 0.0),
        ends("free", EXPLAINED, -200.0, FRICTION),
        ends("grasped", UNEXPLAINED, -10.0),
    )
    assert (name, tried) == ("free", ["chain-2", "free", "grasped"])
    assert found.verdict == EXPLAINED


def test_a_base_that_gives_does_not_stand_where_friction_in_a_hand_is_likelier(monkeypatch) -> None:
    """1.67 times the limit was recommended: what leaves noise may still be the wrong thing."""
    name, found, _ = outcome(
        monkeypatch,
        "free",
        ends("free", EXPLAINED, 0.0, BASE),
        ends("grasped", UNEXPLAINED, -44.0, FRICTION),
    )
    assert name == "grasped" and found.verdict == UNEXPLAINED


@pytest.mark.parametrize(
    ("own", "modelled"),
    [
        (ends("free", EXPLAINED, 0.0, FRICTION), True),
        (ends("free", CONSISTENT, 0.0), True),
        (ends("free", UNEXPLAINED, 0.0), False),  # the model was asked for
    ],
)
def test_no_other_base_model_is_tried_where_none_is_in_question(monkeypatch, own, modelled) -> None:
    assert outcome(monkeypatch, "free", own, modelled=modelled)[::2] == ("free", ["free"])


def test_friction_that_a_second_mode_stands_in_for_unseen(monkeypatch) -> None:
    """1.11 times the limit was recommended, of a chain that left noise."""
    loops = (
        ends("chain-2", CONSISTENT, 0.0),
        ends("free", UNEXPLAINED, 300.0),
        ends("grasped", EXPLAINED, -1768.0, FRICTION),
    )
    assert outcome(monkeypatch, "chain-2", *loops)[::2] == ("chain-2", ["chain-2"])
    name, found, tried = outcome(monkeypatch, "chain-2", *loops, rubbing=-30.0)
    assert (name, found.verdict) == ("grasped", EXPLAINED)
    assert tried == ["chain-2", "free", "grasped"]


@pytest.mark.parametrize(("rubbing", "name"), [(-50.0, "free"), (-60.0, "grasped")])
def test_friction_that_stands_in_for_a_hand(monkeypatch, rubbing, name) -> None:
    """1.12 times the limit was recommended of a free device with friction, which was held."""
    loops = (
        ends("free", EXPLAINED, -50.0, FRICTION),
        ends("grasped", EXPLAINED, rubbing, FRICTION),
    )
    assert outcome(monkeypatch, "free", *loops, rubbing=rubbing)[0] == name


def test_one_mass_that_rubs_is_followed_in_time(monkeypatch) -> None:
    """A hand and Stribeck's friction took its place: as likely as one mass before friction."""
    loops = (
        ends("free", CONSISTENT, -73648.0),
        ends("grasped", EXPLAINED, -74635.0, FRICTION),
        ends("rigid", UNEXPLAINED, 0.0),
    )
    assert outcome(monkeypatch, "free", *loops, rubbing=-74247.0)[0] == "grasped"
    found = outcome(monkeypatch, "free", *loops, rubbing=-74247.0, bare={"grasped": 20.0})
    assert found[:2] == ("rigid", "rigid")


def test_friction_that_was_found_stands_where_the_budget_ends_before_it_is_tried_again(
    monkeypatch,
) -> None:
    asked: list[str] = []
    loops = (ends("free", UNEXPLAINED, 0.0), ends("grasped", UNEXPLAINED, 10.0))
    outcome(monkeypatch, "free", *loops, rubbing=-50.0, taken=asked)
    assert asked == ["grasped"]
    asked.clear()
    loops = (loops[0], ends("grasped", EXPLAINED, -50.0, FRICTION))
    outcome(monkeypatch, "free", *loops, rubbing=-50.0, taken=asked)
    assert asked == []


def test_one_mass_is_followed_in_time(monkeypatch) -> None:
    name, found, tried = outcome(monkeypatch, "rigid")
    assert (name, found, tried) == ("rigid", "rigid", [])


@pytest.mark.parametrize(
    ("behind", "name"), [(0.5 * UNDECIDED, "grasped"), (2 * UNDECIDED, "free")]
)
def test_of_two_that_stand_alike_the_lower_limit_is_taken(monkeypatch, behind, name) -> None:
    found = outcome(
        monkeypatch,
        "free",
        ends("free", EXPLAINED, 0.0, BASE, limit=2.0),
        ends("grasped", EXPLAINED, behind, FRICTION, limit=1.0),
    )
    assert found[0] == name


def test_friction_is_tried_where_the_direct_method_sees_something_linear_alone(monkeypatch) -> None:
    asked = []
    monkeypatch.setattr(direct, "_linear_trials", lambda state, meter: [])
    monkeypatch.setattr(
        direct, "nonlinear_trials", lambda state, raised, meter: asked.append(raised) or []
    )
    linear = residual.Test("causal change", "linear", 12.0, 5.0, None, "")
    assert direct._trials(None, (linear,), Meter()) == []  # type: ignore[arg-type]
    assert "sign(v)" in asked[0]
    direct._trials(
        None, (residual.Test("gain in time", "time-varying", 9.0, 4.4, None, ""),), Meter()
    )  # type: ignore[arg-type]
    assert len(asked) == 1, "drift calls for no force"


def test_friction_is_tried_where_nothing_is_left_and_not_beside_what_leaves_nothing(
    monkeypatch,
) -> None:
    asked = []
    monkeypatch.setattr(
        direct, "nonlinear_trials", lambda state, raised, meter: asked.append(raised) or []
    )
    noise = residual.Test("causal change", "linear", 2.0, 5.0, None, "")
    for accepted in ((), (SimpleNamespace(family="linear"),)):
        state = SimpleNamespace(accepted=accepted)
        direct.trace_directly(SimpleNamespace(state=state, after=(noise,)), Meter())  # type: ignore[arg-type]
    assert len(asked) == 1 and "sign(v)" in asked[0]


def test_a_rubbing_loop_whose_friction_no_test_of_a_force_sees() -> None:
    """Its base model is a chain, and one test, of the command's cube, is flagged just so."""
    case = make(1069)
    truth = case.bench.true_critical_stiffness()
    closed = close_loop(case.recording, hidden=False)
    assert closed.analysis.etfe.direct and closed.analysis.fit.model.name == "free"
    assert [effect.name for effect in closed.effects] == ["coulomb_friction"]
    low, high = (float(closed.analysis.limit.quantile(p)) for p in (0.05, 0.95))
    assert low < truth < high and high < 1.4 * low
    assert np.isclose(
        closed.effects[0].estimates["friction_force"].mean,
        case.friction * case.bench.force_rms,
        rtol=0.1,
    )


def test_what_the_one_candidate_that_convinces_leaves_is_looked_at_once(monkeypatch) -> None:
    """Nothing is compared with it, and what it leaves is what is left when it is taken."""
    there = SimpleNamespace(theta=np.zeros(1), impossible=())
    accepted = Accepted("extra_delay", "another delay", "linear", "")
    looked: list[State] = []
    monkeypatch.setattr(direct, "_left", lambda state: looked.append(state) or ())
    trial = Trial(accepted, State(None, there, (accepted,)), 500.0, 125.0, 1)
    monkeypatch.setattr(direct, "_trials", lambda *_: [trial])
    base = State(None, SimpleNamespace(theta=np.ones(1)))
    found = trace_directly(Traced(UNEXPLAINED, "linear", base, (), ()), Meter())
    assert [one.name for one in found.state.accepted] == ["extra_delay"]
    assert len(looked) == 1
