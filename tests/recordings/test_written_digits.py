"""Positions that were written with few significant digits."""

from __future__ import annotations

import numpy as np
import pytest

from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.checks.written_digits import written_digits
from bayeshaptic.types import Floats

RNG = np.random.default_rng(8)
FORCE = RNG.normal(size=6000)
# A free mass that 0.03 rad a row carry away to 190 rad, and one that stays about zero.
AWAY = 0.03 * np.arange(6000) + 1e-3 * np.cumsum(FORCE)
ABOUT_ZERO = 1e-3 * np.sin(0.05 * np.arange(6000)) + 1e-5 * np.cumsum(FORCE)


@pytest.mark.parametrize(
    ("position", "written", "doubted"),
    [
        (AWAY, "%.4g", True),
        (AWAY - AWAY.mean(), "%.3g", True),
        (AWAY, "%.7g", False),  # steps of 0.0001 at most
        (AWAY, "%.1f", False),  # as coarse everywhere, which is for the test of an encoder
        (ABOUT_ZERO, "%.4g", False),
        (2e-3 * np.round(AWAY / 2e-3), "%.9g", False),  # counts
    ],
)
def test_digits_that_are_fewer_far_from_zero(position: Floats, written: str, doubted: bool) -> None:
    read = np.array([float(written % value) for value in position])
    recording = recording_from_arrays(FORCE, read, 1e-3, force_unit="Nm", position_unit="rad")
    assert [n.topic for n in written_digits(recording)] == ["resolution"] * doubted
    if written == "%.4g":
        told = [n.text for n in check_recording(recording) if "significant digits" in n.text]
        assert len(told) == doubted
        assert not doubted or "4 significant digits: they go in steps of 0.100 rad" in told[0]
