"""A force that repeats while something else moves the device, too: forces have another mean."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

import bayeshaptic as bh
from bayeshaptic.diagnosis.periodic.descent import likeliest
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, balance
from bayeshaptic.diagnosis.periodic.period import one_period
from bayeshaptic.diagnosis.periodic.unrepeated import NOTHING, unrepeated_motion
from bayeshaptic.recordings.response.etfe import compress

PERIOD_S, SAMPLES, PERIODS = 1e-3, 1000, 8
MASS, DAMPER, DRAG = 0.4, 1.0, 12.0


@cache
def dragged(pushed: float, noise: float = 1e-7) -> bh.Recording:
    """One mass with a drag under a multisine, which something else pushes below 4 Hz."""
    rng = np.random.default_rng(3)
    time, lines = np.arange(SAMPLES) * PERIOD_S, np.arange(3, 121)
    phases = -np.pi * np.arange(len(lines)) ** 2 / len(lines)
    force = np.cos(2 * np.pi * lines[:, None] * time + phases[:, None]).sum(axis=0)
    force = np.tile(4 * force / force.std(), PERIODS + 4)
    slow = butter(2, 4.0, fs=1 / PERIOD_S, output="sos")
    push = sosfilt(slow, rng.standard_normal(len(force)))
    push *= pushed / push.std()
    x, v, position, substeps = 0.0, 0.0, [], 20
    h = PERIOD_S / substeps
    for u in (force + push).tolist():
        position.append(x)
        for _ in range(substeps):
            middle = v + 0.5 * h * (u - DAMPER * v - DRAG * v * abs(v)) / MASS
            v += h * (u - DAMPER * middle - DRAG * middle * abs(middle)) / MASS
            x += h * middle
    kept = PERIODS * SAMPLES
    measured = np.array(position[-kept:]) + noise * rng.standard_normal(kept)
    return bh.recording_from_arrays(force[-kept:], measured, period_s=PERIOD_S)


def balanced(pushed: float, seen: bool) -> Balanced:
    """With the drag; what else moves the device is taken from its motion, or left out."""
    etfe = bh.estimate_etfe(dragged(pushed))
    fit = bh.least_squares(bh.rigid(delay_s=0.0), etfe)
    windows, period = compress(etfe), one_period(etfe)
    if not seen:
        period = replace(period, unrepeated=NOTHING)
    without = balance(fit.model, windows, period, (), fit.theta)
    law = force_candidates(fit.model, without.motions)["drag"][0]
    return likeliest(fit.model, windows, period, (law,), without.theta, np.zeros(1))


def test_a_drag_is_sized_beside_another_motion() -> None:
    """Of half the rms: the drag was a fifth too small, and the damper 1.7 times what it is."""
    unaware, found = balanced(0.3, False), balanced(0.3, True)
    assert found.converged
    assert found.strength[0] == pytest.approx(DRAG, abs=2 * found.strength_sd[0])
    assert found.theta[1] == pytest.approx(DAMPER, rel=0.1)
    assert unaware.strength[0] < DRAG - 5 * unaware.strength_sd[0]
    assert unaware.theta[1] > 1.5 * DAMPER


def test_noise_of_the_sensor_is_no_motion() -> None:
    rng = np.random.default_rng(1)
    repeats = np.tile(np.sin(np.linspace(0, 20 * np.pi, SAMPLES, endpoint=False)), PERIODS)
    noise = 1e-3 * rng.standard_normal(len(repeats))
    assert unrepeated_motion(repeats + noise, SAMPLES, PERIOD_S) is NOTHING
    assert unrepeated_motion(repeats[:SAMPLES], SAMPLES, PERIOD_S) is NOTHING


def test_a_device_that_wanders_does_not_jump_between_its_periods() -> None:
    """The mean of such a position ends elsewhere than it begins."""
    rng = np.random.default_rng(2)
    time = np.arange(PERIODS * SAMPLES) * PERIOD_S
    wander = 0.1 * np.sin(2 * np.pi * 0.37 * time) + 0.02 * time
    found = unrepeated_motion(wander + 1e-5 * rng.standard_normal(len(time)), SAMPLES, PERIOD_S)
    speed = np.gradient(wander, PERIOD_S).reshape(-1, SAMPLES)
    inner = np.s_[:, 100:-100]
    np.testing.assert_allclose(found.velocity.mean(axis=0), 0.0, atol=1e-9)
    whole = np.sqrt(PERIODS / (PERIODS - 1))  # what is in the mean counts, too
    apart = (found.velocity - whole * (speed - speed.mean(axis=0)))[inner]
    assert np.abs(apart).max() < 0.02 * np.abs(speed).max()
    assert np.abs(found.velocity).max() < 2 * np.abs(speed).max()
