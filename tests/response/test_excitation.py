"""What kind of force a recording has."""

from __future__ import annotations

import numpy as np
import pytest
from linear_bench import PHANTOM_FREE, Device
from scipy.signal import chirp

from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.checks.sufficiency import too_little
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.signals.excitation import find_repetition
from bayeshaptic.recordings.signals.sweeps import is_sweep, moves_until

RNG = np.random.default_rng(5)
T = 1e-3 * np.arange(20_000)
SWEEPS = {
    "up": chirp(T, 0.5, T[-1], 200.0),
    "logarithmic": chirp(T, 0.5, T[-1], 200.0, method="logarithmic"),
    "again and again": np.tile(chirp(T[:3333], 1.0, T[3333], 300.0), 6),
    "with some noise": chirp(T, 0.5, T[-1], 200.0) + 0.05 * RNG.standard_normal(len(T)),
}
OTHERS = {
    "white": RNG.standard_normal(len(T)),
    "binary": np.sign(RNG.standard_normal(len(T))),
    "multisine": np.cos(2 * np.pi * np.outer(T, np.arange(1, 101)) + RNG.uniform(0, 7, 100)).sum(1),
    "steps": np.repeat(RNG.standard_normal(40), 500),
    "ramps": np.interp(T, np.linspace(0, T[-1], 40), RNG.standard_normal(40)),
    "slow tone": np.sin(2 * np.pi * 2 * T),
    "nothing": np.zeros(len(T)),
    "too short": np.ones(100),
}


@pytest.mark.parametrize("name", SWEEPS)
def test_one_tone_at_a_time_is_a_sweep(name: str) -> None:
    assert is_sweep(SWEEPS[name])


@pytest.mark.parametrize("name", OTHERS)
def test_other_forces_are_none(name: str) -> None:
    assert not is_sweep(OTHERS[name])


def test_a_force_repeats_but_for_its_noise() -> None:
    noise = RNG.standard_normal(len(T))
    one = np.cos(2 * np.pi * np.outer(T, np.arange(1, 101) / 3) + RNG.uniform(0, 7, 100)).sum(1)
    found = find_repetition(one + 0.1 * one.std() * noise)
    assert found is not None and (found.period, found.noisy) == (3000, True)
    assert find_repetition(one + 0.2 * one.std() * noise) is None
    assert find_repetition(one + 0.1 * one.std() * noise, noise=0.0) is None


def test_a_slow_force_of_a_fast_loop_does_not_repeat() -> None:
    """Two samples before it was what it is, to a thousandth, and nothing of it comes again."""
    smooth = np.cos(0.2 * T) + 0.7 * np.cos(0.2 * np.sqrt(2) * T)
    assert np.abs(smooth[2:] - smooth[:-2]).max() < 1e-3 * smooth.std()
    assert find_repetition(smooth) is None


def test_sweeps_of_a_part_of_a_sample_more_do_not_repeat() -> None:
    assert find_repetition(chirp(T % 3.33333, 0.5, 3.33333, 200.0)) is None


def swept(count: float, force: np.ndarray, wander: float = 0.0) -> Recording:
    """A free device that an encoder of this count reads, and that may wander beside its answer."""
    device = Device(PHANTOM_FREE)
    position = device.simulate(force) + wander * np.cumsum(RNG.standard_normal(len(force)))
    units = {"force_unit": "Nm", "position_unit": "rad", "period_s": 1e-3}
    return recording_from_arrays(force=force, position=np.round(position / count) * count, **units)


@pytest.mark.parametrize("name", ["up", "again and again"])
def test_a_sweep_is_used_as_far_as_it_moves_the_device(name: str) -> None:
    """Above, the rounded motion seems to rest for most of the recording: no reason to refuse it."""
    device, count, force = Device(PHANTOM_FREE), 2e-4, 0.02 * SWEEPS[name]
    recording = swept(count, force)
    frequency = np.arange(1.0, 200.0, 0.1)
    span = 2 * 0.02 * np.abs(device.response(frequency))  # from one extreme to the other
    until = moves_until(recording)
    assert until is not None
    # A stretch has tones over nine hertz, and a device that drifts turns on counts beside them.
    assert count < np.interp(until, frequency, span) < 5 * count
    assert too_little(recording) == ()
    assert estimate_etfe(recording).band_hz[1] == pytest.approx(until, rel=0.05)


def test_what_moves_all_the_way_is_used_all_the_way() -> None:
    force = 0.02 * SWEEPS["up"]
    assert moves_until(swept(1e-7, force)) is None
    assert moves_until(swept(2e-4, force, wander=5e-4)) is None
    assert moves_until(swept(2e-4, 0.02 * OTHERS["white"])) is None
