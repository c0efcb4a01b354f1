"""The base model is chosen knowing that it may lack something."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.diagnosis import base_model
from bayeshaptic.diagnosis.base_model import traced_from_best_base
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED
from bayeshaptic.inference.choose import Choice, ScoredFit

SIZES = {"rigid": 2, "free": 6, "grasped": 11}


def fit(name: str, chi_square: float, further: int = 0) -> Any:
    """A fit of 300 windows whose residual has this mean square."""
    return SimpleNamespace(
        model=SimpleNamespace(name=name, size=SIZES[name] + further),
        residual=np.full(300, np.sqrt(chi_square)),
        reduced_chi_square=chi_square,
    )


def traced(name: str, verdict: str, chi_square: float, *sizes: int) -> Any:
    """A loop that accepted effects with so many parameters each."""
    effects = tuple(SimpleNamespace(title="effect", estimates={}) for _ in sizes)
    state = SimpleNamespace(fit=fit(name, chi_square, sum(sizes)), accepted=effects)
    return SimpleNamespace(verdict=verdict, state=state)


def chosen_of(
    monkeypatch: pytest.MonkeyPatch, chosen: str, misfits: dict[str, float], loops: dict[str, Any]
) -> tuple[str, list[str]]:
    """The base model in the end, and those that the loop was closed on."""
    seen = []

    def trace(etfe: Any, fitted: Any, *_: Any) -> Any:
        seen.append(fitted.model.name)
        return loops[fitted.model.name]

    monkeypatch.setattr(base_model, "trace", trace)
    monkeypatch.setattr(base_model, "replace", lambda old, **new: _changed(old, new))
    fits = {name: fit(name, value) for name, value in misfits.items()}
    choice = Choice(fits[chosen], "", {name: ScoredFit(f, 0.0) for name, f in fits.items()})
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
