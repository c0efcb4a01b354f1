"""Friction under a force that repeats: forces and motion follow one another until they agree."""

from __future__ import annotations

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, balance
from bayeshaptic.diagnosis.periodic.steady_motion import LOAD, Following, one_period
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.rig import Bench, Multisine, simulate

FORCE_RMS_N = 0.3


def with_friction(share: float) -> tuple[Balanced, Balanced]:
    """A PHANToM-like device that rubs with so much of the force's rms: fitted without and with."""
    bench = Bench.from_device("phantom", held=False).with_effect(
        "coulomb_friction", force=share * FORCE_RMS_N
    )
    excitation = Multisine(FORCE_RMS_N, 1.0, 120.0, 0.5, 10, phase="random")
    made = simulate(bench, excitation, seed=3)
    recording = bh.recording_from_arrays(made.force, made.position, period_s=bench.period_s)
    etfe = bh.estimate_etfe(recording)
    fit = bh.least_squares(bh.free("phantom"), etfe)
    windows, period = compress(etfe), one_period(etfe)
    without = balance(fit.model, windows, period, (), fit.theta)
    at_the_motor = force_candidates(fit.model, without.motions)["coulomb_friction"][0]
    return without, balance(fit.model, windows, period, (at_the_motor,), without.theta)


def test_dry_friction_is_found() -> None:
    """Each asked for the other's last, and neither settled."""
    without, found = with_friction(0.2)
    assert found.converged
    assert found.rms() < without.rms() / 4
    assert found.strength[0] == pytest.approx(0.2 * FORCE_RMS_N, rel=0.1)


def test_friction_that_holds_the_device_is_not_called_found() -> None:
    """Steps that have become short are not forces that agree with their motion."""
    _, found = with_friction(1.0)
    assert not found.converged


def test_steps_that_turn_back_get_shorter() -> None:
    """A force that asks for minus three times itself: full steps grow without end."""
    following = Following()
    force = np.ones(4)
    for _ in range(30):
        force = following.toward({LOAD: 1.0 - 3.0 * force})[LOAD]
    np.testing.assert_allclose(force, 0.25, rtol=1e-3)
    assert following.arrived


def test_short_steps_have_not_arrived() -> None:
    following = Following()
    for sign in (1.0, -1.0) * 10:
        force = following.toward({LOAD: sign * np.ones(4)})[LOAD]
    assert following.share < 1e-3 and abs(force[0]) < 1.1
    assert not following.arrived
