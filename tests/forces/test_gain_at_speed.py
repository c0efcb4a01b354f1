"""An actuator whose supply is used up: the faster it moves, the less of a command it gives."""

from __future__ import annotations

import numpy as np
import pytest

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.residuals.columns import speed_tests
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.report.headline import headline

PERIOD_S, STEPS, SECONDS = 1e-3, 20, 15.0
MASS, DAMPING, COUNT = 5.39, 6.9, 3e-6
LEVEL = 4.0  # of the force, N: as much as the supply gives at rest
TWO, SIX = [-1.0, 1.0], [-1.0, -0.6, -0.2, 0.2, 0.6, 1.0]


def driven(levels: list[float], lost: float) -> Recording:
    """One mass, and an actuator whose limit falls by `lost` N s/m with the speed."""
    samples = int(SECONDS / PERIOD_S)
    random = np.random.default_rng(5)
    force = LEVEL * np.repeat(random.choice(levels, samples // 3 + 1), 3)[:samples]
    step_s = PERIOD_S / STEPS
    kept = np.exp(-DAMPING / MASS * step_s)
    x, v, position = 0.0, 0.0, np.empty(samples)
    for row, command in enumerate(force.tolist()):
        position[row] = x
        for _ in range(STEPS):
            given = min(max(command, -LEVEL - lost * v), LEVEL - lost * v)
            before, v = v, kept * v + (1 - kept) * given / DAMPING
            x += 0.5 * (before + v) * step_s
    return recording_from_arrays(force, COUNT * np.round(position / COUNT), period_s=PERIOD_S)


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


def test_no_stiffness_where_damping_may_be_what_the_actuator_does_not_give() -> None:
    """Drag or cubic damping stood for it: up to 1.7 times the limit, "explained"."""
    closed = close_loop(driven(SIX, 10.0), model="rigid", delay_s=0.0, hidden=False)
    said = headline(closed)
    assert said.stiffness is None
    assert "the faster it moves" in said.sentence
