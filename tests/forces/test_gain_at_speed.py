"""An actuator whose supply is used up: the faster it moves, the less of a command it gives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.feedback.lacking import with_laws
from bayeshaptic.diagnosis.residuals.supply import LIMIT, SPENT, speed_tests
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.report.headline import headline

PERIOD_S, STEPS, SECONDS = 1e-3, 20, 15.0
MASS, DAMPING, COUNT = 5.39, 6.9, 3e-6
LEVEL = 4.0  # of the force, N: as much as the supply gives at rest
TWO, SIX = [-1.0, 1.0], [-1.0, -0.6, -0.2, 0.2, 0.6, 1.0]


def moved(
    command: Callable[[int, float], float], lost: float, samples: int, count: float
) -> Recording:
    """One mass under `command(row, position)`; the actuator's limit falls by `lost` with speed."""
    step_s = PERIOD_S / STEPS
    kept = np.exp(-DAMPING / MASS * step_s)
    x, v, (force, position) = 0.0, 0.0, np.empty((2, samples))
    for row in range(samples):
        position[row] = count * np.round(x / count)
        force[row] = asked = command(row, float(position[row]))
        for _ in range(STEPS):
            given = min(max(asked, -LEVEL - lost * v), LEVEL - lost * v)
            before, v = v, kept * v + (1 - kept) * given / DAMPING
            x += 0.5 * (before + v) * step_s
    return recording_from_arrays(force, position, period_s=PERIOD_S)


def driven(levels: list[float], lost: float) -> Recording:
    """In open loop, by a force of so many levels."""
    samples = int(SECONDS / PERIOD_S)
    random = np.random.default_rng(5)
    force = LEVEL * np.repeat(random.choice(levels, samples // 3 + 1), 3)[:samples]
    return moved(lambda row, _: float(force[row]), lost, samples, COUNT)


def stepped(lost: float) -> Recording:
    """By a spring and a damper that follow steps."""
    samples, hold, random = 8000, 400, np.random.default_rng(1)
    wanted = np.repeat(random.uniform(-0.012, 0.012, samples // hold), hold)
    spring, damper, past = 400.0, 55.0, {"position": 0.0, "velocity": 0.0}

    def command(row: int, position: float) -> float:
        speed = (position - past["position"]) / PERIOD_S
        past.update(position=position, velocity=0.7 * past["velocity"] + 0.3 * speed)
        asked = spring * (wanted[row] - position) - damper * past["velocity"]
        return float(np.clip(asked, -LEVEL, LEVEL))

    return moved(command, lost, samples, 0.1 * COUNT)


@pytest.mark.parametrize("levels", [TWO, SIX], ids=["two", "six"])
def test_only_an_actuator_whose_supply_is_used_up_gives_less_at_speed(levels: list[float]) -> None:
    scores = []
    for lost in (0.0, 10.0):
        etfe = estimate_etfe(driven(levels, lost))
        fit = least_squares(build_model("rigid", None, 0.0, 0.0, PERIOD_S), etfe)
        (test,) = speed_tests(fit, etfe)
        scores.append(test.statistic)
        assert test.flagged == (lost > 0)
    clean, lacking = scores
    assert lacking > 5 * clean


@pytest.mark.parametrize("levels", [TWO, SIX], ids=["two", "six"])
def test_no_stiffness_where_damping_may_be_what_the_actuator_does_not_give(
    levels: list[float],
) -> None:
    """Drag or cubic damping stood for it: up to 1.7 times the limit, "explained"."""
    closed = close_loop(driven(levels, 10.0), model="rigid", delay_s=0.0, hidden=False)
    said = headline(closed)
    assert said.stiffness is None
    assert "the faster it moves" in said.sentence


@pytest.mark.parametrize("lost", [0.0, 10.0])
def test_a_limit_that_falls_with_the_speed_is_seen_where_noise_seldom_reaches_it(
    lost: float,
) -> None:
    """Saturation was named, and what the speed does to it passed for damping, in green."""
    force = np.random.default_rng(6).normal(0.0, 0.55 * LEVEL, int(SECONDS / PERIOD_S))
    recording = moved(lambda row, _: float(force[row]), lost, len(force), COUNT)
    closed = close_loop(recording, model="rigid", delay_s=0.0, hidden=False)
    assert "actuator_saturation" in [effect.name for effect in closed.effects]
    (test,) = (test for test in closed.traced.after if test.name == LIMIT)
    assert test.flagged == (lost > 0)
    said = headline(closed)
    assert (said.stiffness is None) == (lost > 0)
    assert ("the faster it moves" in said.sentence) == (lost > 0)


@pytest.mark.parametrize("lost", [0.0, 30.0])
def test_in_a_loop_one_mass_whose_actuator_is_spent_on_speed_gets_no_limit(lost: float) -> None:
    motion, _, doubts = with_laws(stepped(lost), None)
    assert any(SPENT in doubt for doubt in doubts) == (lost > 0)
    assert (motion.values[1] > 1.3 * DAMPING) == (lost > 0)  # and the limit with it
