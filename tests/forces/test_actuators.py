"""Actuators that do not give what is commanded: their laws are of the command with its mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from on_the_bench import recorded_on

from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.diagnosis.trials.forces import called_for
from bayeshaptic.diagnosis.trials.nonlinear import nonlinear_trials
from bayeshaptic.effects.library import effects
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench
from bayeshaptic.rig.effects.effect import Effect
from bayeshaptic.rig.excitation import Prescribed
from bayeshaptic.stability import critical_stiffness
from bayeshaptic.types import Floats

HELD = Bench.from_device("lhifam", held=True)
SAMPLES, SEED = 8000, 3
OFFSET = 3.0  # of a force of 4 N rms, as one that holds a weight has


@dataclass(frozen=True)
class Characteristic(Effect):
    """An actuator with a limit, a dead zone, and less of one sign than of the other."""

    name: ClassVar[str] = "characteristic"
    limit: float = 1e6
    zone: float = 0.0
    weaker: float = 0.0  # by how much below zero; where negative, above

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        force = np.clip(force, -self.limit, self.limit)
        force = force - np.clip(force, -self.zone, self.zone)
        return force * np.where(force * self.weaker < 0, 1 - abs(self.weaker), 1.0)


def state_of(actuator: Characteristic, offset: float = 0.0) -> State:
    """A held device behind that actuator, and the linear model fitted to its recording."""
    command = offset + 4.0 * np.random.default_rng(SEED).standard_normal(SAMPLES)
    recording = recorded_on(HELD.with_effect(actuator), Prescribed(command), seed=SEED)
    etfe = estimate_etfe(recording)
    return State(etfe, least_squares(build_model("grasped", "lhifam"), etfe))


def seen(state: State, name: str) -> float:
    """How far a test stands above its threshold."""
    test = {test.name: test for test in nonlinear_tests(state.fit, state.etfe)}[name]
    return test.statistic / test.threshold


def best_of(state: State, raised: str, monkeypatch: pytest.MonkeyPatch) -> Trial:
    """The best of all laws of actuators, with a limit that is that of what it gives in full."""
    names = ("actuator_saturation", "soft_saturation", "dead_zone", "uneven_actuator")
    kinds = [kind for kind in effects("nonlinear") if kind.name in names]
    monkeypatch.setattr(called_for, "effects", lambda family: kinds)
    best = max(nonlinear_trials(state, {raised}, Meter()), key=lambda trial: trial.score)
    assert best.convincing
    limit = critical_stiffness(best.state.model, best.state.fit.theta).value
    assert limit == pytest.approx(HELD.true_critical_stiffness(), rel=0.02)
    left = nonlinear_tests(best.state.fit, best.state.etfe)
    assert not [test.name for test in left if test.flagged]
    return best


@pytest.mark.parametrize("weaker", [0.15, -0.15])
def test_one_that_is_weaker_one_way_is_sized(
    weaker: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It passed for noise of the force: 1.07 times the limit of the stronger way, in green."""
    state = state_of(Characteristic(weaker=weaker))
    assert seen(state, "|u|") > 3
    assert seen(state, "u^3") < 1
    best = best_of(state, "|u|", monkeypatch)
    assert best.name == "uneven_actuator"
    assert best.accepted.estimates["weaker_below_zero_by"].mean == pytest.approx(weaker, rel=0.01)


def test_one_that_gives_what_is_commanded_is_not_uneven() -> None:
    for offset in (0.0, OFFSET):
        assert seen(state_of(Characteristic(), offset), "|u|") < 1


@pytest.mark.parametrize(
    ("name", "size", "actuator"),
    [
        ("actuator_saturation", 8.0, Characteristic(limit=8.0)),
        ("dead_zone", 0.8, Characteristic(zone=0.8)),
        ("uneven_actuator", 0.15, Characteristic(weaker=0.15)),
    ],
    ids=["saturation", "dead zone", "uneven"],
)
def test_a_force_with_an_offset(
    name: str, size: float, actuator: Characteristic, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Laws had been of the command without its mean: a dead zone was none, 1.09 times the limit."""
    best = best_of(state_of(actuator, OFFSET), "u^3", monkeypatch)
    assert best.name == name
    assert next(iter(best.accepted.estimates.values())).mean == pytest.approx(size, rel=0.02)
