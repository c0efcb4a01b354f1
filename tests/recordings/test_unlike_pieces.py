"""Pieces that count together and do not have one response are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bayeshaptic.diagnosis.analyse import analyse
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.checks.unlike_pieces import named_unlike, unlike_pieces
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.join import join_recordings
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, Multisine, WhiteNoise, simulate

BENCH = Bench("rigid", {"m": 2.0, "b": 12.0}, delay_s=0.7e-3, encoder_resolution=2e-6)


def recorded(seed: int, seconds: float = 4.0, bench: Bench = BENCH) -> Recording:
    made = simulate(bench, WhiteNoise(5.0, 400.0, seconds=seconds), seed)
    return recording_from_arrays(made.force, made.position, 1e-3, name=f"day {seed}")


def warned(*pieces: Recording) -> tuple[Notice, ...]:
    return unlike_pieces(estimate_etfe(join_recordings(pieces)))


def test_pieces_of_one_device_are_alike() -> None:
    for seed in range(0, 40, 4):
        lengths = (3.0, 1.0, 8.0, 2.0)
        assert not warned(*(recorded(seed + n, length) for n, length in enumerate(lengths)))


def test_pieces_under_multisines_are_alike() -> None:
    made = [simulate(BENCH, Multisine(rms, 1.0, 200.0)) for rms in (5.0, 2.0)]
    assert not warned(*(recording_from_arrays(o.force, o.position, 1e-3) for o in made))


@pytest.mark.parametrize(
    ("other", "told"),
    [
        (replace(BENCH, values={"m": 2.6, "b": 12.0}), "0.7"),
        (replace(BENCH, delay_s=1.7e-3), "behind"),
        (BENCH.with_effect("coulomb_friction", force=2.0), "times as large"),
    ],
    ids=["heavier", "later", "rubbing"],
)
def test_another_device_among_them_is_named(other: Bench, told: str) -> None:
    (notice,) = warned(recorded(1), recorded(2, bench=other), recorded(3), recorded(4))
    assert named_unlike([notice]) == ("day 2",)
    assert "beside that of the 3 others, day 2" in notice.text
    assert told in notice.text


def test_other_units_and_a_sign_turned_round_are_named_as_such() -> None:
    second = recorded(2)
    turned = replace(second, position=-second.position)
    degrees = replace(second, position=np.degrees(second.position))
    (sign,) = warned(recorded(1), turned, recorded(3))
    assert "day 2 has the opposite sign (" in sign.text
    (unit,) = warned(recorded(1), degrees, recorded(3))
    assert "day 2 is 57.3 times as large, as one in degrees is of one in radians" in unit.text


def test_of_two_that_differ_each_is_named_beside_the_other() -> None:
    heavier = replace(BENCH, values={"m": 2.6, "b": 12.0})
    (notice,) = warned(recorded(1), recorded(2, bench=heavier))
    assert "day 1" in notice.text
    assert "day 2" in notice.text


def test_pieces_of_one_name_are_numbered() -> None:
    heavier = replace(BENCH, values={"m": 2.6, "b": 12.0})
    some = recorded(1), recorded(2, bench=heavier), recorded(3)
    (notice,) = warned(*(replace(one, name="array") for one in some))
    assert named_unlike([notice]) == ("array and 2 others, piece 2",)


def test_no_stiffness_follows_from_them() -> None:
    heavier = replace(BENCH, values={"m": 2.3, "b": 12.0})
    joined = join_recordings([recorded(1), recorded(2, bench=heavier), recorded(3)])
    told = headline(analyse(joined, "rigid", ess=300))
    assert told.stiffness is None
    assert "do not have one response (day 2)" in told.sentence


def test_signs_that_cancel_are_not_said_to_be_a_weak_answer() -> None:
    """Together they hardly answer to the force, and a stronger one was asked for."""
    second = recorded(2)
    joined = join_recordings([recorded(1), replace(second, position=-second.position)])
    with pytest.raises(InputError, match="opposite sign"):
        analyse(joined, "free", ess=300)
