"""The sampling period from time stamps."""

from __future__ import annotations

import numpy as np
import pytest

from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.checks.loop_period import doubts_of_the_loop, without_doubt
from bayeshaptic.recordings.checks.two_clocks import two_clocks
from bayeshaptic.recordings.signals.rows.runs import held_for, held_unevenly
from bayeshaptic.recordings.signals.rows.timing import sampling_period
from bayeshaptic.types import Floats, Ints

RNG = np.random.default_rng(3)
N = 5000
EVEN = 1e-3 * np.arange(N)


def test_even_stamps() -> None:
    for start, period in ((0.0, 1e-3), (1.7e9, 1e-3), (-3.0, 1 / 1024), (0.0, 4e-4)):
        timing = sampling_period(start + period * np.arange(N))
        # A second of 2026 has its last digit at 2.4e-7 s: that is the error over the whole length.
        assert timing.period_s == pytest.approx(period, rel=1e-6)
        assert timing.jitter is not None
        assert timing.jitter < 1e-3
    assert sampling_period(EVEN).period_s == 1e-3


@pytest.mark.parametrize("digits", [3, 4, 5, 6])
def test_stamps_that_were_rounded_are_even(digits: int) -> None:
    # 700 us in milliseconds: two stamps in ten are equal, and still no sample is late.
    timing = sampling_period(np.round(0.7e-3 * np.arange(N), digits))
    assert timing.period_s == pytest.approx(0.7e-3, rel=1e-4)
    assert timing.jitter == 0


@pytest.mark.parametrize("coarse_s", [0.015625, 0.1, 1.0])
@pytest.mark.parametrize("seconds", [3, 10])
def test_stamps_that_many_rows_share_say_the_period(coarse_s: float, seconds: int) -> None:
    # Whole seconds of a spreadsheet, the ticks of Windows; the first and last stair are cut off.
    for first in (0.0, 0.3, 0.7):
        stamps = np.floor((first + 1e-3 * np.arange(1000 * seconds)) / coarse_s) * coarse_s
        timing = sampling_period(stamps)
        # A stair begins within a row, and the outermost are two seconds apart at least.
        assert timing.period_s == pytest.approx(1e-3, rel=1e-3)
        assert timing.jitter == 0


def test_a_buffer_that_was_written_twice_is_read_once() -> None:
    force, position = RNG.normal(size=N), 1e-6 * np.cumsum(RNG.normal(size=N))
    rows = np.concatenate([np.arange(2048), np.arange(2016, 4096), np.arange(3000, N)])
    for period_s in (None, 1e-3):
        read = recording_from_arrays(force[rows], position[rows], period_s, EVEN[rows])
        np.testing.assert_array_equal(read.force, force)
        assert ("note", "time stamps") in [(n.level, n.topic) for n in read.notices]
        assert f"{len(rows) - N} rows repeat" in " ".join(n.text for n in read.notices)
    # Another reading at the same time is none, nor is a clock that began again.
    other = position[rows]
    other[2060] += 1e-6
    for again, stamps in ((other, EVEN[rows]), (position[rows], 1e-3 * (rows % 2500))):
        with pytest.raises(InputError, match="time does not advance"):
            recording_from_arrays(force[rows], again, time=stamps)


@pytest.mark.parametrize(
    ("bits", "tick_s", "jitter"), [(16, 1e-5, 0), (16, 1e-6, 20), (32, 1e-9, 0)]
)
def test_a_timer_that_begins_again_is_counted_on(bits: int, tick_s: float, jitter: int) -> None:
    ticks = np.round(0.3 / tick_s + EVEN / tick_s + jitter * RNG.normal(size=N))
    for period_s in (None, 1e-3):
        timing = sampling_period(ticks % 2**bits * tick_s, period_s)
        assert timing.period_s == pytest.approx(1e-3, rel=1e-4)
        assert timing.jitter == pytest.approx(jitter * tick_s * np.sqrt(2) / 1e-3, rel=0.1)
        assert [n.level for n in timing.notices] == ["note"]
        assert f"a timer of {bits} bits" in timing.notices[0].text
    for range_ in (0.97 * 2**bits, 2**12 * 1e-3 / tick_s):  # neither a timer's, nor of a buffer
        with pytest.raises(InputError):
            sampling_period(np.round(EVEN / tick_s) % range_ * tick_s)


@pytest.mark.parametrize("jitter", [0.002, 0.02])
def test_jitter_is_measured(jitter: float) -> None:
    stamps = EVEN + 1e-3 * jitter / np.sqrt(2) * RNG.normal(size=N)
    timing = sampling_period(stamps)
    # The difference of two stamps; sd of an sd from N samples with neighbours correlated by -1/2.
    assert timing.jitter == pytest.approx(jitter, rel=5 * np.sqrt(1.5 / 2 / N))
    assert timing.period_s == pytest.approx(1e-3, rel=1e-5)


def test_one_late_stamp_is_no_gap() -> None:
    stamps = EVEN.copy()
    stamps[100] += 0.7e-3
    assert sampling_period(stamps).period_s == pytest.approx(1e-3, rel=1e-5)


def drop(stamps: np.ndarray, *rows: int) -> np.ndarray:
    return np.delete(stamps, rows)


def replaced(index: int, value: float) -> np.ndarray:
    stamps = EVEN.copy()
    stamps[index] = value
    return stamps


WRONG = {
    "about 9 samples are missing after row 100 .*to 4991: read it alone with --rows 101:4991": drop(
        EVEN, *range(100, 109)
    ),
    "about 2 samples are missing after row 7 .*40 such places": drop(
        EVEN, *range(7, 4687, 117), *range(8, 4688, 117)
    ),
    "about 1 sample.* missing after row 40 .*such places.*too few .* a logger that keeps up": drop(
        EVEN, 40, *(100 + np.flatnonzero(RNG.random(N - 100) < 0.03))
    ),
    "time does not advance from row 10 to row 11 .*1 such place": replaced(10, EVEN[9]),
    "time does not advance from row 5 to row 6": replaced(5, 0.001),
    "4 rows have the time of the row before them, the first is row 9 .*twice": np.sort(
        np.append(EVEN, EVEN[[7, 50, 51, 300]])
    ),
    "out of turn.* row 12 .0.01 s. after 0.011 s .2 such places.; sort the rows": EVEN[
        [*range(10), 11, 10, *range(12, 502), 503, 502, *range(504, N)]
    ],
    "most rows have the time .* too coarse .*--period-s": np.floor(EVEN[:1200] + 0.7),
    "the time in row 4 is nan": replaced(3, np.nan),
    "not even: they vary by 58 %": np.cumsum(1e-3 * RNG.uniform(1e-3, 2, size=N)),
    "they vary by 20 %": np.cumsum(1e-3 + 2e-4 * np.clip(RNG.normal(size=N), -4, 4)),
    "they vary by 28 %": EVEN + 2e-4 * RNG.normal(size=N),  # some stamps run back
    "not even": np.concatenate([EVEN, EVEN[-1] + 2 * EVEN[1:]]),
    "2 time stamps; a period needs at least 3": EVEN[:2],
}


@pytest.mark.parametrize("message", WRONG)
def test_stamps_that_cannot_be_used(message: str) -> None:
    with pytest.raises(InputError, match=message):
        sampling_period(WRONG[message])
    # Whoever gives the period is believed, and warned.
    timing = sampling_period(WRONG[message], 1e-3)
    assert timing.period_s == 1e-3
    (notice,) = timing.notices
    assert notice.level == "warning"


def test_a_period_beside_stamps() -> None:
    assert sampling_period(EVEN, 1e-3).notices == ()
    assert sampling_period(EVEN, 1.005e-3).notices == ()
    (notice,) = sampling_period(EVEN, 1e-4).notices
    assert "show a period of 0.001 s" in notice.text
    assert sampling_period(None, 1e-4).jitter is None
    for period in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="above 0"):
            sampling_period(EVEN, period)


def with_lost_rows(count: float) -> tuple[Floats, Floats, Ints, Recording]:
    """White force on a mass, read in counts; 21 rows are lost, two of them beside each other."""
    force = RNG.normal(size=N)
    velocity = np.cumsum(force)
    position = np.cumsum(velocity - velocity.mean())
    position = count * np.round(position / count)
    lost = np.sort(RNG.choice(np.arange(100, N - 100), 20, replace=False))
    lost = np.append(lost, lost[-1] + 1)
    kept = np.setdiff1d(np.arange(N), lost)
    found = recording_from_arrays(force[kept], position[kept], time=EVEN[kept])
    assert found.samples == N
    assert found.period_s == pytest.approx(1e-3, rel=1e-5)
    assert np.array_equal(found.force[kept], force[kept])
    assert np.array_equal(found.position[kept], position[kept])
    (note,) = (n for n in found.notices if n.topic == "time stamps")
    assert note.level == "note"
    assert "are missing by their time stamps, 2 at most" in note.text
    return force, position, lost, found


def test_rows_that_a_logger_lost_are_put_back_as_the_motion_shows() -> None:
    force, position, lost, found = with_lost_rows(0.3)
    assert np.std((found.force - force)[lost]) < 0.1
    assert np.max(np.abs(found.position[lost] - position[lost])) < 0.5


def test_a_force_that_the_motion_hardly_shows_is_put_back_as_its_mean() -> None:
    """Else noise of the encoder would be in it, and the response too large by it."""
    _, position, lost, found = with_lost_rows(30.0)
    assert np.std(found.force[lost]) < 0.5  # of 48 coefficients none is sure
    assert np.max(np.abs(found.position[lost] - position[lost])) < 60


def test_a_force_of_two_levels_is_put_back_between_them() -> None:
    """Held for five samples, it is expected not to change at most of them, and changes at some."""
    held = np.repeat(RNG.choice([-1.0, 1.0], N // 5), 5)
    velocity = np.cumsum(held)
    position = np.round(np.cumsum(velocity - velocity.mean()))
    lost = 100 + 121 * np.arange(40)
    kept = np.setdiff1d(np.arange(N), lost)
    found = recording_from_arrays(held[kept], position[kept], time=EVEN[kept]).force
    assert np.abs(found).max() <= 1
    assert np.std((found - held)[lost]) < 0.3


@pytest.mark.parametrize("later_s", [3000.0, 20000.0])
def test_stamps_of_single_precision_are_an_even_clock(later_s: float) -> None:
    stamps = np.float32(later_s + 1e-3 * np.arange(12_000))
    found = sampling_period(stamps.astype(float))
    assert found.period_s == pytest.approx(1e-3, rel=1e-6)
    assert found.jitter == 0.0 and not found.notices


def test_a_gap_in_stamps_of_single_precision_is_seen() -> None:
    index = np.arange(12_000)
    index[6_000:] += 3
    stamps = np.float32(3000.0 + 1e-3 * index).astype(float)
    found = sampling_period(stamps)
    assert found.rows is not None and found.rows[-1] == index[-1]


@pytest.mark.parametrize("often", [2, 5])
def test_rows_that_are_written_several_times_are_read_once(often: int) -> None:
    rng = np.random.default_rng(3)
    force, position = rng.standard_normal(2000), np.round(50 * rng.standard_normal(2000)) / 50
    twice = [np.repeat(one, often)[1:] for one in (force, position)]
    found = recording_from_arrays(*twice, period_s=1e-3 / often)
    assert found.period_s == pytest.approx(1e-3)
    # The first row is the last of its kind.
    assert np.array_equal(found.force[-1990:], force[-1990:])
    assert np.array_equal(found.position[-1990:], position[-1990:])
    assert any(f"stands {often} times" in notice.text for notice in found.notices)


@pytest.mark.parametrize("rows", [2, 3, 8])
def test_a_force_that_is_held_leaves_the_period_of_its_loop_open(rows: int) -> None:
    rng = np.random.default_rng(4)
    force, position = np.repeat(rng.standard_normal(1000), rows)[1:], rng.standard_normal
    stamps = 1e-3 * np.arange(len(force))
    moved = position(len(force))

    def read(period_s: float | None = None, time: Floats | None = stamps) -> Recording:
        return recording_from_arrays(force, moved, period_s=period_s, time=time)

    open_ = read()
    assert open_.samples == len(force) and doubts_of_the_loop(open_.notices)
    assert f"held for {rows} rows" in open_.notices[0].text
    # Who says the period has said which loop it is.
    every_row, changes = read(1e-3), read(1e-3 * rows)
    assert every_row.samples == len(force) and changes.period_s == pytest.approx(1e-3 * rows)
    assert np.array_equal(changes.force, force[rows - 1 :: rows])
    assert np.array_equal(changes.position, moved[rows - 1 :: rows])
    for told in (every_row, changes):
        assert not any(notice.topic == "period" for notice in told.notices)
    # Without stamps nobody can say both; a device's file says that of the loop.
    unstamped = read(1e-3, None)
    assert [notice.level for notice in unstamped.notices if notice.topic == "period"] == ["warning"]
    assert not doubts_of_the_loop(unstamped.notices)
    device = load_device("lhifam")
    assert not without_doubt(open_.notices[:1], 1e-3, device)
    assert without_doubt(open_.notices[:1], 2e-3, device) == open_.notices[:1]


def test_a_clock_that_slips_holds_a_force_all_the_same() -> None:
    rng = np.random.default_rng(5)
    force = rng.standard_normal(1000)[(np.arange(8000) / 8.03).astype(int)]
    assert held_for(force) == 8


@pytest.mark.parametrize("rows", [1.01, 1.25, 10 / 7, 2.5, 3.3])
def test_a_force_whose_clock_beats_with_that_of_the_rows(rows: float) -> None:
    rng = np.random.default_rng(8)
    newest = (np.arange(20_000) / rows).astype(int)
    force = rng.standard_normal(20_000)
    smooth = np.cumsum(force)
    for played in (force, smooth):
        assert held_for(played[newest]) == 1
        assert held_unevenly(played[newest]) == pytest.approx(rows, rel=1e-3)
    moved = rng.standard_normal(20_000)
    open_ = recording_from_arrays(force[newest], moved, time=1e-3 * np.arange(20_000))
    assert doubts_of_the_loop(open_.notices) and "in the mean" in open_.notices[0].text
    said = recording_from_arrays(force[newest], moved, 1e-3, time=1e-3 * np.arange(20_000))
    assert not doubts_of_the_loop(said.notices)


@pytest.mark.parametrize("rows", [1.02, 1.25, 2.5])
def test_rows_that_a_faster_log_wrote_again_are_read_once(rows: float) -> None:
    rng = np.random.default_rng(10)
    force, moved = rng.standard_normal((2, 20_000))
    newest = (np.arange(20_000) / rows).astype(int)
    stamps = 1e-3 * np.arange(20_000)
    found = recording_from_arrays(force[newest], np.round(moved, 1)[newest], time=stamps)
    assert found.period_s == pytest.approx(rows * 1e-3, rel=1e-3)
    assert np.array_equal(found.force, force[1 : newest[-1] + 1])
    assert np.array_equal(found.position, np.round(moved, 1)[1 : newest[-1] + 1])
    assert not doubts_of_the_loop(found.notices)
    assert any("in the mean" in notice.text for notice in found.notices)


def test_rows_that_nobody_knows_to_be_written_again_are_kept() -> None:
    """The position stands so often that it says nothing, or some of the loop's forces are alike."""
    rng = np.random.default_rng(11)
    force, moved = rng.standard_normal((2, 20_000))
    newest = (np.arange(20_000) / 1.25).astype(int)
    again = force.copy()
    again[:4000:200] = again[1:4000:200]
    standing = np.sign(moved - 9).astype(float)
    for one, other in ((force, standing), (again, np.round(moved, 1))):
        found = recording_from_arrays(one[newest], other[newest], time=1e-3 * np.arange(20_000))
        assert found.samples == 20_000 and doubts_of_the_loop(found.notices)


def test_forces_that_repeat_themselves_by_chance_have_no_clock_of_their_own() -> None:
    rng = np.random.default_rng(9)
    noise, turns = rng.standard_normal(20_000), np.arange(20_000)
    ramps = np.abs((0.8 * turns) % 800 - 400)  # a converter's counts, equal steps
    missed = noise[np.maximum.accumulate(np.where(rng.random(20_000) < 0.2, 0, turns))]
    for force in (noise, np.round(noise, 1), np.round(3 * noise), ramps.round(), missed):
        assert held_unevenly(force) == 1
    assert held_unevenly(np.sign(np.sin(turns * np.pi / 2.3 + 0.1))) == 1


def test_other_forces_that_stand_are_not_held() -> None:
    rng = np.random.default_rng(6)
    smooth = np.cumsum(rng.standard_normal(20_000))
    holds = np.repeat(rng.standard_normal(4000), rng.integers(1, 12, size=4000))
    square = np.sign(np.sin(np.arange(5000) * np.pi / 13 + 0.1))
    for force in (np.round(smooth), holds, square, rng.standard_normal(5000)):
        assert held_for(force) == 1


@pytest.mark.parametrize("rows", [2, 4, 8])
def test_a_position_that_is_read_more_slowly_than_the_force_changes_is_warned_of(rows: int) -> None:
    rng = np.random.default_rng(7)
    moved = 1e-5 * np.round(np.cumsum(rng.standard_normal(6000)))
    force = rng.standard_normal(len(moved))

    def warnings(position: Floats) -> list[str]:
        read = recording_from_arrays(force, position, period_s=1e-3)
        return [one.text for one in read.notices if one.topic == "held position"]

    (text,) = warnings(np.repeat(moved[::rows], rows))
    assert f"held for {rows} rows, {rows}.00 ms" in text
    # Counts that are seldom passed are no clock.
    for position in (moved, 1e-4 * np.round(moved / 1e-4)):
        assert not warnings(position)


def test_two_clocks_are_warned_of_and_a_device_that_changes_is_none() -> None:
    from scipy.interpolate import CubicSpline
    from scipy.signal import lfilter

    rng = np.random.default_rng(8)
    rows = np.arange(18_000)
    force = lfilter([0.3], [1, -0.7], rng.standard_normal(len(rows) + 20))
    soft, firm = (1e-4 * lfilter([0, 0, 1], [1, -1.9, stiff], force) for stiff in (0.905, 0.93))

    def warned(position: Floats) -> list[str]:
        moved = position[: len(rows)] + 1e-6 * rng.standard_normal(len(rows))
        read = recording_from_arrays(force[: len(rows)], moved, period_s=1e-3)
        return [one.text for one in two_clocks(read)]

    for rate in (1e-4, -1e-4):
        (text,) = warned(CubicSpline(np.arange(len(soft)), soft)(rows * (1 + rate)))
        assert ("earlier and earlier" if rate > 0 else "later and later") in text
        assert float(text.split(" millionths")[0].split()[-1]) == pytest.approx(100, rel=0.05)
    for position in (soft, np.where(np.arange(len(soft)) < 9000, soft, firm)):
        assert not warned(position)
