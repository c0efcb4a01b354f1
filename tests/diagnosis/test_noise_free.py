"""A recording without any noise, in double precision: nothing is left to be found in it."""

from __future__ import annotations

import numpy as np
from scipy.linalg import expm
from scipy.signal import butter, chirp, lfilter

import bayeshaptic as bh
from bayeshaptic.diagnosis.residuals.excess import excess_noise_test
from bayeshaptic.recordings.response.spectra import REPEATS_TO
from bayeshaptic.report.headline import headline

T, N = 1e-3, 8000
TRUTH = {"m1": 0.19, "b1": 0.1, "bc": 15.0, "kc": 55.3e3, "m2": 5.2, "b2": 6.8}
BAND = butter(2, [1, 300], "band", fs=1 / T)
NOISE = 2 * lfilter(*BAND, np.random.default_rng(0).normal(size=N))


def step_of(values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Two masses, a spring and dampers under a force that is held for T, exactly."""
    m1, b1, bc, kc, m2, b2 = values.values()
    a = np.zeros((5, 5))
    a[:2, 2:4] = np.eye(2)
    a[2] = [-kc / m1, kc / m1, -(b1 + bc) / m1, bc / m1, 1 / m1]
    a[3, :4] = [kc / m2, -kc / m2, bc / m2, -(b2 + bc) / m2]
    step = expm(a * T)
    return step[:4, :4], step[:4, 4]


def recorded(force: np.ndarray) -> bh.Recording:
    by_state, by_force = step_of(TRUTH)
    state, position = np.zeros(4), np.empty(N)
    for k in range(N):
        position[k] = state[0]
        state = by_state @ state + by_force * force[k]
    return bh.recording_from_arrays(force, position, T, force_unit="N", position_unit="m")


def is_stable(stiffness: float) -> bool:
    by_state, by_force = step_of(TRUTH)
    closed = by_state - stiffness * np.outer(by_force, [1, 0, 0, 0])
    return bool(np.abs(np.linalg.eigvals(closed)).max() < 1 + 1e-12)


def test_the_device_is_found_and_nothing_else() -> None:
    result = bh.close_loop(recorded(NOISE), delay_s=0.0)  # as the recording is made
    assert result.verdict == "consistent" and not result.effects
    head = headline(result)
    assert head.status == "safe" and head.risk == 0.01
    limit = result.analysis.limit
    assert is_stable(limit.quantile(0.001)) and not is_stable(limit.quantile(0.999))
    assert limit.quantile(0.95) < 1.01 * limit.quantile(0.05)


def test_no_response_is_known_better_than_a_device_repeats() -> None:
    etfe = bh.estimate_etfe(recorded(NOISE))
    widest = np.diff(etfe.spectra.edges).max()
    assert etfe.relative_sd.min() > REPEATS_TO / np.sqrt(10 * widest)
    assert np.median(etfe.relative_sd) < 1e-3


def test_leakage_of_a_chirp_is_no_force() -> None:
    time = T * np.arange(N)
    etfe = bh.estimate_etfe(recorded(2.8 * chirp(time, 0.5, time[-1], 400, method="log")))
    (found,) = excess_noise_test(bh.least_squares(bh.free(), etfe), etfe)
    assert not found.flagged
