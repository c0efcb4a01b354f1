"""Positions that jump: a new zero is counted on across, another recording is a piece of its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.types import Floats

COUNT = 2e-6


def moved(force: Floats, count: float = COUNT) -> Floats:
    """A damped mass from rest, read in counts."""
    velocity = lfilter([0.0, 1e-5], [1, -0.99], force)
    return np.asarray(count * np.round(np.cumsum(velocity) / count))


def pieces(lengths: tuple[int, ...], count: float = COUNT) -> tuple[Floats, Floats]:
    """Motions from rest, elsewhere each time, one after the other."""
    rng = np.random.default_rng(4)
    force = rng.normal(size=sum(lengths))
    parts = np.split(force, np.cumsum(lengths)[:-1])
    places = 0.004 * np.resize([1.0, -1.5, 2.0], len(lengths))
    joined = [moved(f, count) + at for f, at in zip(parts, places, strict=True)]
    return force, np.concatenate(joined)


def read(force: Floats, position: Floats) -> Recording:
    return recording_from_arrays(force, position, period_s=1e-3, force_unit="N", position_unit="m")


def told(recording: Recording) -> str:
    (text,) = [notice.text for notice in recording.notices if notice.topic == "jumps"]
    return text


@pytest.mark.parametrize("count", [2e-6, 1e-4])
def test_recordings_one_after_the_other_are_pieces(count: float) -> None:
    """Their response was read across, behind a coarse encoder, too."""
    recording = read(*pieces((4000, 5000, 4500), count))
    assert recording.joints == (4000, 9000)
    assert "read as 3 pieces" in told(recording)


def test_a_new_zero_is_counted_on_across() -> None:
    rng = np.random.default_rng(5)
    for seed in range(20):
        force = rng.normal(size=12000)
        position = moved(force)
        zero = int(rng.integers(1000, 11000))
        position[zero:] -= position[zero] + 0.02
        recording = read(force, position)
        assert recording.joints == (), seed
        assert "counted on across" in told(recording)


def test_a_slow_motion_behind_a_coarse_encoder_did_not_hang() -> None:
    """A few rows without a count before a jump were taken for a reading that hung."""
    rng = np.random.default_rng(6)
    force = rng.normal(size=9000)
    position = moved(0.1 * force, 1e-4)
    position[3960:4000] = position[3959]
    position[4000:] += 0.01
    assert "jumps once" in told(read(force, position))


def test_joints_stay_with_their_rows() -> None:
    """Where a file is written more often than the loop runs, and a standstill is left out."""
    force, position = pieces((4000, 5000))
    off = np.full(2000, position[0])
    more = np.random.default_rng(6).normal(size=2000)
    twice = [np.repeat(np.append(a, b), 2) for a, b in ((more, force), (off, position))]
    recording = read(*twice)
    (joint,) = recording.joints
    assert recording.samples - joint == 5000
    assert recording.force[joint] == force[4000]


def test_the_rough_response_is_not_averaged_across_joints() -> None:
    """Pieces of a good recording "hardly answered to the force"."""
    recording = read(*pieces((1500,) * 8, 1e-5))
    assert len(recording.joints) == 7
    assert rough_response(recording).follows > 0.9
    assert not [notice for notice in check_recording(recording) if notice.topic == "coherence"]
