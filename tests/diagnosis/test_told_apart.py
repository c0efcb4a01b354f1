"""What was not told apart is decided beside what was found later: a spring, and then a lag."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_bench import Device
from scipy.signal import lfilter

from bayeshaptic.diagnosis.periodic.lines import LineTrials
from bayeshaptic.diagnosis.residuals.residual import Test as ResidualTest
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.protocol import Trials
from bayeshaptic.diagnosis.trials.windows import WindowTrials
from bayeshaptic.inference import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe

LAG_S, FINE = 1.5e-3, 10
SPRING = {"masses": [0.5], "ground": [(8.0, 300.0)], "links": []}
LINEAR = (ResidualTest("linear", "linear", 99.0, 1.0, None, ""),)


def behind_a_lag(periods: int, samples: int = 4000) -> Etfe:
    """A device on a spring behind an actuator that is late, in steps of a tenth of a period."""
    rng = np.random.default_rng(2)
    force = np.tile(rng.normal(size=samples), periods) if periods > 1 else rng.normal(size=16_000)
    decay = np.exp(-1e-3 / FINE / LAG_S)
    held = np.repeat(force, FINE)
    late = lfilter([(1 - decay) / 2] * 2, [1, -decay], held)  # its mean over each step
    position = Device(SPRING, period=1e-3 / FINE, delay=0.0).simulate(late)[::FINE]
    position = position + 1e-3 * position.std() * rng.normal(size=len(position))
    return estimate_etfe(recording_from_arrays(force, position, 1e-3), (1.0, 200.0))


@pytest.fixture(scope="module", params=[1, 8], ids=["noise", "periods"])
def kind(request: pytest.FixtureRequest) -> Trials:
    etfe = behind_a_lag(request.param)
    fit = least_squares(build_model("rigid", delay_s=0.0, period_s=1e-3), etfe)
    return LineTrials(etfe, fit) if request.param > 1 else WindowTrials(State(etfe, fit))


def with_spring_and_lag(kind: Trials) -> State:
    """The state with both, the first of them as if another effect had done as well."""
    state = kind.first
    for name in ("centring_stiffness", "actuator_lag"):
        found = kind.trials(state, LINEAR, Meter(60.0), patient=False)
        state = next(trial.state for trial in found if trial.name == name)
    return tied(state)


def tied(state: State) -> State:
    first, *others = state.accepted
    return replace(state, accepted=(replace(first, ties=("other",), limit_log_sd=9.0), *others))


def test_a_tie_that_is_decided_spreads_no_longer(kind: Trials) -> None:
    before = with_spring_and_lag(kind)
    after = kind.told_apart(before, Meter(60.0))
    spring, lag = after.accepted
    assert (spring.name, lag.name) == ("centring_stiffness", "actuator_lag")
    # A base far softer than the spring is the same spring, and has its limit.
    assert spring.limit_log_sd < 0.01
    assert "other" not in spring.ties
    assert after.fit is before.fit


def test_what_is_tied_still_is_named_and_nothing_is_asked_of_the_last(kind: Trials) -> None:
    both = with_spring_and_lag(kind)
    before = tied(replace(both, accepted=both.accepted[::-1]))
    lag, spring = kind.told_apart(before, Meter(60.0)).accepted
    assert lag.name in ("actuator_lag", "position_filter")
    assert {"actuator_lag", "position_filter"} <= {lag.name, *lag.ties}
    assert lag.limit_log_sd < 0.01  # either gives the same limit
    assert spring == before.accepted[1]


def test_without_a_tie_it_is_the_very_same(kind: Trials) -> None:
    state = with_spring_and_lag(kind)
    sure = replace(state, accepted=tuple(replace(a, limit_log_sd=0.0) for a in state.accepted))
    assert kind.told_apart(sure, Meter(60.0)) is sure
