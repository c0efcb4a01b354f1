"""Rows that are early and late by turns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.checks.uneven_rows import doubts_of_the_rows, uneven_rows
from bayeshaptic.types import Floats

ROWS = 12_000


def moved_by(force: Floats, seed: int, count: float = 1e-5) -> Floats:
    """A damped mass behind an encoder, disturbed by a hundredth of the command."""
    rng = np.random.default_rng(seed)
    pushed = force + 0.01 * force.std() * rng.standard_normal(len(force))
    moved = 1e-4 * lfilter([0, 0, 1], [1, -1.9, 0.905], pushed)
    return count * np.round(moved / count)


@pytest.mark.parametrize("faster", [1.06, 1.19, 1.5, 2.3])
def test_the_newest_rows_of_a_faster_loop_are_uneven(faster: float) -> None:
    force = np.random.default_rng(1).standard_normal(int(faster * ROWS) + 1)
    newest = np.floor(faster * np.arange(ROWS)).astype(int)
    moved = moved_by(force, 2)
    (told,) = uneven_rows(recording_from_arrays(force[newest], moved[newest], 1e-3))
    assert doubts_of_the_rows([told])
    # One row in `step` is even.
    step = max(2, round(faster))
    assert not uneven_rows(recording_from_arrays(force[::step], moved[::step], 1e-3))
    assert not uneven_rows(recording_from_arrays(force[:ROWS], moved[:ROWS], 1e-3))


@pytest.mark.parametrize("period", [100, 200, 400])
def test_motion_that_repeats_has_lines_of_its_own(period: int) -> None:
    """Behind a coarse encoder, whose errors repeat with it."""
    rng = np.random.default_rng(3)
    force = np.tile(rng.standard_normal(period), ROWS // period)
    moved = moved_by(force, 4, count=1e-3)
    assert not uneven_rows(recording_from_arrays(force, moved, 1e-3))
