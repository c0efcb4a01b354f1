"""Noise that a device makes itself where it changes from moment to moment."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

import bayeshaptic as bh
from bayeshaptic.diagnosis.residuals import excess
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.headline import headline
from bayeshaptic.report.objections import why_none

T, N = 1e-3, 20_000
M1, M2, BC, KC, B1, B2 = 0.1, 0.4, 0.5, 40e3, 0.1, 5.0  # a mode at 112 Hz
DELAY = T


def step_of(stiffness: float, step_s: float = T) -> tuple[np.ndarray, np.ndarray]:
    """States (x1, x2, v1, v2) a step later, by state and by the force that is held."""
    k = np.array([[stiffness, -stiffness], [-stiffness, stiffness]])
    b = np.array([[BC + B1, -BC], [-BC, BC + B2]])
    mass = np.array([[M1], [M2]])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-k / mass, -b / mass]])
    both = expm(step_s * np.block([[a, np.array([[0, 0, 1 / M1, 0]]).T], [np.zeros((1, 5))]]))
    return both[:4, :4], both[:4, 4]


def recorded(wander: float, samples: int = N, force: np.ndarray | None = None) -> Recording:
    """White noise; the stiffness is another one of five every 50 ms, `wander` apart at most."""
    rng = np.random.default_rng(3)
    force = rng.standard_normal(samples) if force is None else force
    steps = [step_of(KC * (1 + wander * share)) for share in (-1, -0.5, 0, 0.5, 1)]
    which = np.repeat(rng.integers(5, size=samples // 50), 50)
    state, position = np.zeros(4), np.empty(samples)
    for sample in range(samples):
        position[sample] = state[0]
        by_state, by_force = steps[which[sample]]
        state = by_state @ state + by_force * force[sample - 1] * (sample > 0)
    count = 1e-6
    return recording_from_arrays(
        force=force, position=count * np.round(position / count), period_s=T
    )


def limit_of(stiffness: float) -> float:
    """The stiffest wall that is stable with a period of delay, by bisection."""
    by_state, by_force = step_of(stiffness)
    late = np.block([[by_state, by_force[:, None]], [np.zeros((1, 5))]])
    low, high = 1.0, 1e6
    while high / low > 1 + 1e-9:
        middle = np.sqrt(low * high)
        closed = late - middle * np.outer(np.eye(5)[4], np.eye(5)[0])
        stable = np.abs(np.linalg.eigvals(closed)).max() < 1 + 1e-12
        low, high = (middle, high) if stable else (low, middle)
    return low


def fitted(recording: Recording) -> tuple[Fit, bh.Etfe]:
    etfe = bh.estimate_etfe(recording)
    return bh.least_squares(bh.free(delay_s=DELAY, period_s=T), etfe), etfe


def test_a_mode_that_wanders_is_noise_of_the_device() -> None:
    fit, etfe = fitted(recorded(0.1))
    (found,) = excess.excess_noise_test(fit, etfe)
    mode_hz = np.sqrt(KC * (1 / M1 + 1 / M2)) / (2 * np.pi)
    assert found.flagged and found.frequency_hz == pytest.approx(mode_hz, rel=0.1)
    assert (
        excess.changing_share(fit, etfe, mode_hz)
        > 0.5
        > 20 * excess.changing_share(fit, etfe, 30.0)
    )


def test_a_steady_one_is_none() -> None:
    fit, etfe = fitted(recorded(0.0))
    (found,) = excess.excess_noise_test(fit, etfe)
    assert not found.flagged and excess.changing_share(fit, etfe) < 1e-4


@pytest.mark.parametrize("samples", [1500, 2000, 3000, 4000])
def test_a_steady_one_that_rings_on_is_none(samples: int) -> None:
    """Leakage has the poles of the response: a mode of 112 Hz at the end of two seconds."""
    fit, etfe = fitted(recorded(0.0, samples))
    (found,) = excess.excess_noise_test(fit, etfe)
    (without,) = excess.excess_noise_test(fit, etfe.blurred)
    assert not found.flagged and without.statistic > 20


def test_the_limit_goes_as_far_down_as_the_mean_hides() -> None:
    """The mean response is flatter and wider than the mode ever is: 'safe', and far too high."""
    result = bh.close_loop(recorded(0.1), bh.free(delay_s=DELAY, period_s=T))
    truth = limit_of(KC)
    assert result.verdict == "unexplained"
    limit = result.analysis.limit
    assert limit.quantile(0.05) < truth < limit.quantile(0.95)
    head = headline(result)
    assert head.status == "untrusted" and head.stiffness is None
    assert any("from moment to moment" in reason for reason in why_none(result))
