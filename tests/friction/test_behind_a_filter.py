"""Dry friction of a device whose position is read through a slow low-pass, or whose force is slow.

To the response both are the same; friction opposes the motion of the mass, before the filter.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.signal import lfilter

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.residuals.force_curve import force_curve
from bayeshaptic.diagnosis.residuals.pieces import force_in_pieces
from bayeshaptic.effects.linear.low_pass import ActuatorLag, PositionFilter
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import rigid
from bayeshaptic.models.response.filters import Filter, in_time, share
from bayeshaptic.models.start import informed
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe

PERIOD_S, STEPS = 1e-3, 20
MASS, DAMPING, LAG_S = 0.2, 2.0, 8e-3


def recorded(friction: float, of_position: bool, seconds: float = 10.0, seed: int = 1) -> Recording:
    """A mass that rubs, under white noise, with a low-pass of the position or of the force."""
    step = PERIOD_S / STEPS
    command = 3.0 * np.random.default_rng(seed).standard_normal(int(seconds / PERIOD_S))
    force = np.repeat(command, STEPS)
    left = np.exp(-step / LAG_S)
    if not of_position:
        force = lfilter([1 - left], [1, -left], force)
    push, decay = force * step / MASS, np.exp(-DAMPING / MASS * step)
    stop, velocity, motion = friction * step / MASS, 0.0, np.empty(len(force))
    for k, one in enumerate(push.tolist()):
        before, slid = velocity, velocity * decay + one
        velocity = np.sign(slid) * max(abs(slid) - stop, 0.0)
        motion[k] = (before + velocity) / 2
    position = np.cumsum(motion) * step
    if of_position:
        half = (1 - left) / 2  # of a position that goes straight on
        position = lfilter([half, half], [1, -left], position)
    read = np.concatenate([[0.0], position[STEPS - 1 :: STEPS][:-1]])
    count = 1e-5
    return recording_from_arrays(command, count * np.round(read / count), period_s=PERIOD_S)


def limit() -> float:
    """By the poles of the sampled loop, of which the low-pass may be at either end."""
    states = np.array(
        [[0, 1, 0, 0], [0, -DAMPING / MASS, 0, 1 / MASS], [1 / LAG_S, 0, -1 / LAG_S, 0], [0] * 4]
    )
    step = expm(states * PERIOD_S)

    def margin(stiffness: float) -> float:
        loop = step[:3, :3] - stiffness * np.outer(step[:3, 3], [0, 0, 1])
        return float(np.abs(np.linalg.eigvals(loop)).max()) - 1

    return float(brentq(margin, 1.0, 1e3))


@pytest.mark.parametrize("of_position", [True, False])
def test_friction_tells_where_the_low_pass_is(of_position: bool) -> None:
    friction = 0.2  # as much as the damper's force
    made = recorded(friction, of_position)
    found = close_loop(made, "rigid", delay_s=0.0, held=False, hidden=False)
    assert found.verdict == "explained"
    low_pass, rubs = found.effects
    assert low_pass.name == ("position_filter" if of_position else "actuator_lag")
    assert rubs.name == "coulomb_friction"
    assert rubs.estimates["friction_force"].mean == pytest.approx(friction, rel=0.05)
    low, median, high = found.analysis.limit.quantile(np.array([0.05, 0.5, 0.95]))
    assert low < limit() < high
    assert median == pytest.approx(limit(), rel=0.1)
    # What the low-pass did to the limit before is none of what friction leaves open.
    assert high / low < 1.5


@pytest.mark.parametrize("kind", [PositionFilter, ActuatorLag])
@pytest.mark.parametrize("of_position", [True, False])
def test_friction_is_seen_on_either_side(
    of_position: bool, kind: type[PositionFilter] | type[ActuatorLag]
) -> None:
    def score(friction: float) -> float:
        etfe = estimate_etfe(recorded(friction, of_position))
        model = informed(rigid(delay_s=0.0, delay_sd_s=0.0), etfe)
        fit = least_squares(model.with_effect(kind.candidates(model, etfe)[0]), etfe)
        (test,) = (one for one in force_in_pieces(fit, etfe) if one.name == "sign(v)")
        return test.statistic / test.threshold

    assert score(0.2) > 2.0
    assert score(0.0) < 1.0


def test_a_force_over_a_motion_that_hardly_turns_round_has_a_curve() -> None:
    etfe = estimate_etfe(recorded(0.2, True, seconds=4.0))
    fit = least_squares(informed(rigid(delay_s=0.0, delay_sd_s=0.0), etfe), etfe)
    assert etfe.recording is not None
    along = 1.0 + 0.01 * np.random.default_rng(3).standard_normal(etfe.recording.samples)
    curve = force_curve(fit, etfe, "velocity", along)
    assert len(curve.motion) == 2 and np.all(np.isfinite(curve.sd))


def test_a_filter_in_time_is_that_of_the_response() -> None:
    lag, damping = 5e-3, 0.3
    filters = (
        Filter(np.array([[1.0]]), np.array([[1.0], [lag]]), True),
        Filter(np.array([[1.0]]), np.array([[1.0], [2 * damping * lag], [lag**2]]), True),
    )
    for frequency_hz in (3.0, 30.0):
        s = np.array([2j * np.pi * frequency_hz])
        time = np.arange(2000) * 1e-4
        seen = in_time(filters, np.exp(s * time), 1e-4)
        assert seen[-1] / np.exp(s * time)[-1] == pytest.approx(share(filters, s)[0], rel=2e-3)
