"""Rows that are early and late by turns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.checks.loop_period import doubts_of_the_loop
from bayeshaptic.recordings.signals.rows.uneven_rows import uneven_rows
from bayeshaptic.report.headline import headline
from bayeshaptic.report.page.next_step import next_steps
from bayeshaptic.rig import Bench, WhiteNoise, simulate
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
    stamps = 1e-3 * np.arange(ROWS)
    found = recording_from_arrays(force[newest], moved[newest], time=stamps)
    (doubt,) = doubts_of_the_loop(found.notices)
    assert "not evenly apart" in doubt
    # A loop that runs at every row, and whose sensor has a clock of its own.
    said = recording_from_arrays(force[newest], moved[newest], 1e-3, time=stamps)
    assert not doubts_of_the_loop(said.notices)
    # Without stamps the period is that of the rows, and says nothing of the loop's.
    bare = recording_from_arrays(force[newest], moved[newest], 1e-3)
    assert any("not evenly apart" in notice.text for notice in bare.notices)
    # One row in `step` is even.
    step = max(2, round(faster))
    for every in (slice(0, step * (len(force) // step), step), slice(ROWS)):
        assert uneven_rows(force[every], moved[every], 1e-3, True) is None


@pytest.mark.parametrize("period", [100, 200, 400])
def test_motion_that_repeats_has_lines_of_its_own(period: int) -> None:
    """Behind a coarse encoder, whose errors repeat with it."""
    rng = np.random.default_rng(3)
    force = np.tile(rng.standard_normal(period), ROWS // period)
    moved = moved_by(force, 4, count=1e-3)
    assert uneven_rows(force, moved, 1e-3, True) is None


def test_a_cascade_of_two_rates_is_named_beside_rows_that_are_uneven() -> None:
    """An inner loop at every row, and an outer one that tells it a speed at every fourth."""
    rng = np.random.default_rng(9)
    places = np.repeat(rng.uniform(-1, 1, ROWS // 600), 600)
    wanted = lfilter([0.02**2], [1, -1.96, 0.98**2], places)
    read, force = np.zeros(ROWS), np.zeros(ROWS)
    moved = speed = told = seen = 0.0
    for k in range(1, ROWS):
        moved, speed = moved + speed, 0.995 * speed + 0.1 * force[k - 1]
        read[k] = 1e-3 * np.round(moved / 1e-3)
        seen += 0.12 * (read[k] - read[k - 1] - seen)
        if k % 4 == 0:
            told = 0.02 * (wanted[k] - read[k])
        force[k] = 0.3 * (told - seen)
    stamps = 1e-3 * np.arange(ROWS)
    found = recording_from_arrays(force, read, time=stamps)
    (doubt,) = doubts_of_the_loop(found.notices)
    assert "outer loop runs at every few" in doubt
    said = recording_from_arrays(force, read, 1e-3, time=stamps)
    assert not doubts_of_the_loop(said.notices)


def test_a_position_that_never_changes_says_nothing_of_its_rows() -> None:
    force = np.random.default_rng(5).standard_normal(ROWS)
    assert uneven_rows(force, np.zeros(ROWS), 1e-3, True) is None


def test_a_page_asks_for_every_row_and_gives_no_other_reason() -> None:
    made = simulate(Bench.from_device("phantom"), WhiteNoise(0.05, 200.0, 0.7, 6.0), seed=4)
    newest = np.floor(1.3 * np.arange(int(len(made.force) / 1.3))).astype(int)
    found = recording_from_arrays(
        made.force[newest],
        made.position[newest],
        time=1e-3 * np.arange(len(newest)),
        force_unit="Nm",
        position_unit="rad",
    )
    closed = close_loop(found, "free", hidden=False)
    said = headline(closed)
    assert said.status == "untrusted" and said.sentence.endswith("with --period-s.")
    every, alone = next_steps(said, closed)
    assert "every row" in every.text and alone.command.endswith("--period-s 0.001")
