"""Facts that raw samples show: resolution, clipping."""

from __future__ import annotations

import numpy as np
import pytest

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.raw_signals import clipping, count_of, increment_unit

RNG = np.random.default_rng(0)
MOTION = np.cumsum(np.cumsum(RNG.normal(size=5000)) * 1e-5 * np.hanning(5000))


@pytest.mark.parametrize("count", [3.14e-6, 2e-4, 2 * np.pi / 2**20, 1e-9])
@pytest.mark.parametrize("offset", [0.0, -7.3])
def test_the_count_of_an_encoder(count: float, offset: float) -> None:
    motion = MOTION * (30 * count / np.abs(np.diff(MOTION)).mean())
    reading = offset + count * np.round(motion / count)
    assert increment_unit(reading) == pytest.approx(count, rel=1e-4)
    # Nine digits, as files have them, hide a count that is finer than them.
    if count > 1e-7:
        written = np.array([float(f"{value:.9g}") for value in reading])
        assert increment_unit(written) == pytest.approx(count, rel=1e-3)


def test_an_encoder_that_never_moves_by_one_count() -> None:
    counts = RNG.choice([2, 3, 7, 9], size=1000) * RNG.choice([-1, 1], size=1000)
    assert increment_unit(1e-6 * np.cumsum(counts)) == pytest.approx(1e-6)


def test_a_continuous_signal_has_no_count() -> None:
    assert increment_unit(MOTION) is None
    assert increment_unit(RNG.normal(size=300)) is None
    assert increment_unit(np.zeros(100)) is None
    assert increment_unit(np.arange(3.0)) is None


def test_a_file_rounded_to_a_sixth_of_a_count() -> None:
    count = 5.992e-6
    reading = np.round(count * np.round(MOTION / count), 6)
    assert increment_unit(reading) == pytest.approx(count, rel=1e-3)


@pytest.mark.parametrize(
    ("seen", "declared", "known"),
    [(2e-4, None, 2e-4), (0, 1e-4, 1e-4), (2e-4, 1e-4, 2e-4), (1e-5, 1e-4, 1e-4)],
)
def test_a_count_is_as_declared_or_coarser(
    seen: float, declared: float | None, known: float
) -> None:
    reading = seen * np.round(MOTION / seen) if seen else MOTION
    recording = Recording(reading, reading, 1e-3, encoder_resolution=declared)
    assert count_of(recording) == pytest.approx(known, rel=1e-6)


def test_clipping() -> None:
    signal = np.round(RNG.normal(size=10_000), 2)
    found = clipping(np.clip(signal, -np.inf, 1.5))
    assert (found.high, found.high_clipped, found.low_clipped) == (1.5, True, False)
    assert found.high_samples == np.count_nonzero(signal >= 1.5)
    assert not clipping(signal).high_clipped
    assert not clipping(RNG.normal(size=1000)).low_clipped
    relay = clipping(np.where(signal > 0, 3.0, -3.0))
    assert not (relay.low_clipped or relay.high_clipped)
    assert not clipping(np.zeros(100)).low_clipped
