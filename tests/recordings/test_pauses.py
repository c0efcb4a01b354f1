"""Several runs in one file: a long step of the time, or one back, begins another piece."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.read import read_recording
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

PERIOD_S = 1e-3
LENGTHS = 1500, 400, 2100
EDGES = np.cumsum((0, *LENGTHS))
RNG = np.random.default_rng(7)
FORCE = RNG.normal(size=EDGES[-1])
POSITION = np.cumsum(np.cumsum(FORCE)) * 1e-6
RUNS = [np.arange(n) * PERIOD_S for n in LENGTHS]


def stamped(kind: str) -> Floats:
    """The times of three runs."""
    first, second, third = RUNS
    if kind == "pauses":
        return np.concatenate([first, second + 3.7, third + 9.0004])
    if kind == "begins again":
        return np.concatenate(RUNS)
    second = second + first[-1]  # each with the stamp that the one before ended with
    return np.concatenate([first, second, third + second[-1]])


def read(time: Floats, period_s: float | None = None) -> Recording:
    return recording_from_arrays(
        FORCE, POSITION, period_s, time=time, force_unit="N", position_unit="m"
    )


@pytest.mark.parametrize("period_s", [None, PERIOD_S])
@pytest.mark.parametrize("kind", ["pauses", "begins again", "repeated"])
def test_runs_in_one_file_are_pieces(kind: str, period_s: float | None) -> None:
    """They were refused; with the period given they were read across, as one motion."""
    recording = read(stamped(kind), period_s)
    assert recording.joints == tuple(EDGES[1:-1])
    assert recording.period_s == pytest.approx(PERIOD_S, rel=1e-6)
    for piece, start, stop in zip(recording.pieces, EDGES[:-1], EDGES[1:], strict=True):
        np.testing.assert_array_equal(piece.force, FORCE[start:stop])
    (text,) = [n.text for n in recording.notices if n.topic == "time stamps"]
    assert "3 runs" in text and "row 1501" in text and "--rows 1901:4000" in text


def test_rows_that_a_run_lost_are_put_back_in_it() -> None:
    lost = [200, 201, 2700, 2701, 3300]
    keep = np.delete(np.arange(EDGES[-1]), lost)
    recording = recording_from_arrays(
        FORCE[keep],
        POSITION[keep],
        time=stamped("pauses")[keep],
        force_unit="N",
        position_unit="m",
    )
    assert recording.joints == tuple(EDGES[1:-1]) and recording.samples == EDGES[-1]
    told = [n.text for n in recording.notices if "put back" in n.text]
    assert [text.split(":")[0] for text in told] == [
        "In the rows from 1 on",
        "In the rows from 1899 on",
    ]


def test_what_is_no_run_is_refused_as_before() -> None:
    time = stamped("pauses")
    with pytest.raises(InputError, match="samples are missing after row 1499"):
        read(np.delete(np.append(time, 20 + time[:1]), 0))  # a lone row, seconds later
    slower = np.concatenate([RUNS[0], 5 + 2 * RUNS[1], 9 + RUNS[2]])
    with pytest.raises(InputError, match="samples are missing"):
        read(slower)
    twice = np.concatenate([FORCE[:1500], FORCE[:1500]])
    again = np.concatenate([RUNS[0], RUNS[0] + 5.0])
    with pytest.raises(InputError, match="row 1501 has the same samples as that at row 1"):
        recording_from_arrays(twice, twice**2, time=again, force_unit="N", position_unit="m")


def test_a_clock_without_pauses_has_one_run() -> None:
    """Of 400 with jitter, lost rows, late stamps, few digits, or a timer that begins again."""
    rng = np.random.default_rng(3)
    even = np.arange(EDGES[-1]) * PERIOD_S
    for number in range(400):
        time = even + PERIOD_S * rng.uniform(0, 0.06) * rng.standard_normal(len(even))
        late = rng.integers(300, len(even), 3)
        time[late] += rng.uniform(0.2, 0.9) * PERIOD_S
        if number % 4 == 1:
            time = np.round(even, 3 + number % 3)
        elif number % 4 == 2:
            time = np.round(even / 1e-5) % 2**16 * 1e-5
        elif number % 4 == 3:
            time = time.astype(np.float32).astype(float)
        try:
            recording = read(time)
        except InputError:
            continue
        assert recording.joints == ()


def test_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "session.csv"
    rows = np.stack([stamped("pauses"), FORCE, POSITION], axis=1)
    np.savetxt(path, rows, delimiter=",", header="time_s,force_n,position_m", comments="")
    assert len(read_recording(path).pieces) == 3
    assert len(read_recording(path, rows=(1, 1900)).pieces) == 2
    assert len(read_recording(path, seconds=(0.0, 3.0)).pieces) == 1
