"""Friction under a force that repeats: forces and motion follow one another until they agree."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.signal import chirp

import bayeshaptic as bh
from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, balance
from bayeshaptic.diagnosis.periodic.period import one_period
from bayeshaptic.diagnosis.periodic.steady_motion import Following
from bayeshaptic.effects.laws import fitted
from bayeshaptic.effects.nonlinear.internal_force import LOAD
from bayeshaptic.effects.nonlinear.shapes import Usual
from bayeshaptic.numerics.extrapolation import Approach
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.rig import Bench, Multisine, simulate
from bayeshaptic.rig.effects.nonlinear import Drag
from bayeshaptic.rig.excitation import Excitation, Prescribed

FORCE_RMS_N = 0.3
PHANTOM = Bench.from_device("phantom", held=False)


def balanced(
    bench: Bench, excitation: Excitation, law: str, seed: int, settled: int = 0
) -> tuple[Balanced, Balanced]:
    """A free PHANToM-like device under a force that repeats, fitted without and with a law.

    From the sample on from which it has settled.
    """
    made = simulate(bench, excitation, seed=seed)
    force, position = made.force[settled:], made.position[settled:]
    recording = bh.recording_from_arrays(force, position, period_s=bench.period_s)
    etfe = bh.estimate_etfe(recording)
    fit = bh.least_squares(bh.free("phantom"), etfe)
    windows, period = compress(etfe), one_period(etfe)
    without = balance(fit.model, windows, period, (), fit.theta)
    at_the_motor = force_candidates(fit.model, without.motions)[law][0]
    return without, balance(fit.model, windows, period, (at_the_motor,), without.theta)


def with_friction(share: float, seed: int) -> tuple[Balanced, Balanced]:
    """It rubs with so much of the force's rms."""
    bench = PHANTOM.with_effect("coulomb_friction", force=share * FORCE_RMS_N)
    excitation = Multisine(FORCE_RMS_N, 1.0, 120.0, 0.5, 10, phase="random")
    return balanced(bench, excitation, "coulomb_friction", seed)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_dry_friction_is_found(seed: int) -> None:
    """Each asked for the other's last, and neither settled; and a device that rubs moves on."""
    without, found = with_friction(0.1, seed)
    assert found.converged
    assert found.rms() < without.rms() / 4
    assert found.strength[0] == pytest.approx(0.1 * FORCE_RMS_N, rel=0.1)


def test_a_force_comes_back_from_a_worker() -> None:
    """A study of a periodic recording with friction ended in the pickling of its result."""
    _, found = with_friction(0.1, 0)
    (force,), (kept,) = found.forces, pickle.loads(pickle.dumps(found)).forces
    motion = found.motions[force.place]
    assert np.array_equal(kept.force(motion), force.force(motion))
    usual = Usual.of(motion.velocity, motion.position, "rad")
    shapes = [(name, shape.name) for name, shape in fitted(force.place, usual)]
    assert len(set(shapes)) == len(shapes)  # they are found again by these


def test_a_drag_is_sized_while_a_constant_force_drives_the_device_on() -> None:
    """A sweep is no two halves alike: without its mean velocity a drag was a twelfth too small.

    Half as strong as the damper, it came nearer by a fourteenth of the way with each round.
    """
    coefficient, period, rate = 0.002, 2.5, 1e3
    time = np.arange(round(8 * period * rate)) / rate
    force = PHANTOM.force_rms * 2**0.5 * chirp(time % period, 0.5, period, 200.0)
    bench = PHANTOM.with_effect(Drag(coefficient, "m1"))
    without, found = balanced(bench, Prescribed(tuple(force)), "drag", seed=3, settled=10_000)
    assert found.converged
    assert found.rms() < 1.5 < 10 < without.rms()
    assert found.strength[0] == pytest.approx(coefficient, rel=0.01)


def test_a_sequence_is_followed_to_its_end() -> None:
    """Overshooting with every other step, as forces that are followed do."""
    approach = Approach(1)
    for n in range(6):
        point = np.array([2.0 - 0.9**n + 0.01 * (-0.9) ** n, 5.0 + 0.9**n])
        assert approach.ahead(point) is point
    end = approach.ahead(np.array([2.0 - 0.9**6 + 0.01 * 0.9**6, 5.0 + 0.9**6]))
    np.testing.assert_allclose(end, [2.0, 5.0], rtol=1e-9)
    leaps = Approach(1)
    rng = np.random.default_rng(0)
    for n in range(20):
        point = np.array([2.0 - 0.9**n * rng.uniform(0.5, 1.5)])
        assert leaps.ahead(point) is point, "no end in sight"


def test_friction_that_holds_the_device_is_not_called_found() -> None:
    """Steps that have become short are not forces that agree with their motion."""
    _, found = with_friction(1.0, seed=3)
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
