"""Commands that take effect early or late, told from a hand, a floor and noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from fake_analysis import fake_analysis
from scipy.signal import lfilter

from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.samples.command_times import CommandTimes, command_times
from bayeshaptic.errors import Notice
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.report.beside_command import beside_command, what_changes
from bayeshaptic.types import Bools, Floats

_MASS, _DAMPER, _PERIOD_S = 0.4, 1.2, 1e-3
_SAMPLES = 20_000


def motion(force: Floats, period_s: float) -> Floats:
    """Of a damped mass under a held force, exactly; position before each sample."""
    decay = np.exp(-_DAMPER / _MASS * period_s)
    speed = lfilter([0, (1 - decay) / _DAMPER], [1, -decay], force)
    # x' = v, and v' = (F - b v)/m: integrated once, m v + b x = integral of F.
    pushed = np.concatenate([[0], np.cumsum(force)[:-1]]) * period_s
    return np.asarray((pushed - _MASS * speed) / _DAMPER)


def late(command: Floats, which: Bools) -> Floats:
    """The force at twice the rate, whose commands come half a period late where `which` says."""
    twice = np.repeat(command, 2)
    before = np.concatenate([[0], command[:-1]])
    twice[0::2] = np.where(which, before, command)
    return twice


def found(which: Bools, seed: int, push: float = 0.0, hiss: float = 0.0) -> CommandTimes:
    """What is found where a force besides, and an amplifier whose gain hisses, act as well."""
    rng = np.random.default_rng(seed)
    command = rng.standard_normal(_SAMPLES)
    force = late(command, which) * (1 + hiss * np.repeat(rng.standard_normal(_SAMPLES), 2))
    force += push * np.repeat(rng.standard_normal(_SAMPLES), 2)
    position = motion(force, _PERIOD_S / 2)[::2]
    count = np.std(position) / 5000
    recording = recording_from_arrays(command, np.round(position / count) * count, _PERIOD_S)
    begun = begin(recording, "rigid", Options(held=False))
    times = command_times(begun.fit, begun.etfe)
    assert times is not None
    return times


def rows_of(what: str, seed: int) -> Bools:
    k = np.arange(_SAMPLES)
    if what == "by chance":
        return np.random.default_rng(seed + 100).random(_SAMPLES) < 0.4
    return k % {"second": 2, "third": 3, "none": _SAMPLES}[what] == 1


@pytest.mark.parametrize(("what", "rows"), [("second", 2), ("third", 3)])
def test_a_pattern_of_late_commands_is_named_by_its_rows(what: str, rows: int) -> None:
    times = found(rows_of(what, 1), 1)
    assert times.rows == rows and times.pattern > 20
    assert times.how is not None and f"a pattern of {rows} rows" in times.how
    (notice,) = times.notices
    assert notice.topic == "command times" and "turned from row to row" in notice.text


def test_commands_that_are_late_by_chance_are_told_by_their_increments() -> None:
    """Of three recordings each: noise, an amplifier's or anybody's, is no late command."""
    for seed in range(3):
        times = found(rows_of("by chance", seed), seed)
        assert times.how is not None and times.how.startswith("by chance")
        assert times.pattern < 5
    for seed in range(3):
        nothing = rows_of("none", seed)
        for besides in ({}, {"push": 0.5}, {"hiss": 0.5}):
            times = found(nothing, seed, **besides)
            assert times.how is None and times.notices == ()


def test_scores_are_those_of_chance_where_nothing_is_late() -> None:
    """Normal ones: beyond three standard deviations hardly any of 16 may be."""
    scores = []
    for seed in range(8):
        times = found(rows_of("none", seed), seed, push=0.3)
        scores += [times.chance, times.of_increments]
        assert times.pattern < 5  # the largest of many
    assert np.max(np.abs(scores)) < 4 and 0.4 < np.std(scores) < 1.7


def test_the_report_says_what_may_be_behind_a_motion_beside_the_command() -> None:
    analysis = fake_analysis("free", "lhifam")
    own = analysis.recording
    time = np.arange(own.samples) * own.period_s
    shaken = own.position + 0.5 * np.std(own.position) * np.sin(2 * np.pi * 4 * time)
    analysis.etfe = replace(analysis.etfe, recording=replace(own, position=shaken))
    said = beside_command(analysis)
    assert said is not None and "something else moves it" in said
    assert "commands take effect early or late" in said and "friction, or" in what_changes(analysis)
    analysis.notices += (Notice("warning", "command times", "They do."),)
    said = beside_command(analysis)
    assert said is not None and "something else moves it" not in said
    assert what_changes(analysis) == "commands take effect early or late"
