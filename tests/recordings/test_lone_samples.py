"""Single positions far from those beside them: few of them, and more than the device moves."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from on_the_bench import recorded_on

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.signals.lone import lone, without_lone
from bayeshaptic.rig import Bench, Multisine, WhiteNoise
from bayeshaptic.rig.excitation import BinaryNoise, Chirp, Steps

SECONDS = 6.0
EXCITATIONS = {
    "white": lambda rms: WhiteNoise(rms, 200.0, 0.5, SECONDS),
    "binary": lambda rms: BinaryNoise(rms, 200.0, SECONDS),
    "steps": lambda rms: Steps(rms, 0.3, SECONDS),
    "chirp": lambda rms: Chirp(rms, 1.0, 300.0, SECONDS),
}


@cache
def recorded(name: str, excitation: str = "white", held: bool = False) -> Recording:
    bench = Bench.from_device(name, held=held)
    return recorded_on(bench, EXCITATIONS[excitation](bench.force_rms), seed=2)


def struck(recording: Recording, count: int, size: float, seed: int = 0) -> Recording:
    """With so many positions off by a multiple of all the motion's spread."""
    rng = np.random.default_rng(seed)
    at = 50 + 40 * rng.permutation((recording.samples - 100) // 40)[:count]
    position = recording.position.copy()
    position[at] += rng.choice([-size, size], count) * position.std()
    return replace(recording, position=position)


@pytest.mark.parametrize("name", ["lhifam", "phantom"])
@pytest.mark.parametrize("excitation", EXCITATIONS)
def test_no_motion_is_a_lone_sample(name: str, excitation: str) -> None:
    assert not lone(recorded(name, excitation).position).any()


def test_they_are_found_near_the_ends() -> None:
    position = np.sin(np.arange(3000) / 40)
    wrong = position.copy()
    wrong[[3, 2995]] += 5.0
    assert np.flatnonzero(lone(wrong)).tolist() == [3, 2995]


def test_a_resting_encoder_that_flickers_has_none() -> None:
    rng = np.random.default_rng(1)
    position = 2.0 + 1e-5 * (rng.random(20_000) < 0.001)
    assert not lone(position).any()


@pytest.mark.parametrize("size", [3.0, -40.0])
def test_a_position_that_jumps_and_stays_there_has_none(size: float) -> None:
    """Counts that were lost at once: the samples on both sides are off, as far as each other."""
    position = recorded("lhifam").position.copy()
    position[3000:] += size * position.std()
    assert not lone(position).any()


@pytest.mark.parametrize("held", [False, True])
def test_those_that_are_off_are_found_and_nothing_else(held: bool) -> None:
    clean = recorded("lhifam", held=held)
    wrong = struck(clean, 5, 3.0)
    assert np.array_equal(lone(wrong.position), wrong.position != clean.position)
    mended = without_lone(wrong).position
    assert np.abs(mended - clean.position).max() < 3 * clean.encoder_resolution


@pytest.mark.parametrize("count", [1, 3, 6])
def test_a_few_that_hid_the_motion_are_named_and_cost_nothing(count: int) -> None:
    """Refused at the door, or taken for noise with a limit of a third to all of the truth."""
    clean, told = recorded("lhifam"), {"device": "lhifam", "held": False}
    plain, mended = (close_loop(one, **told) for one in (clean, struck(clean, count, 20.0)))
    assert mended.effect_names == ("wild_samples",)
    ends = np.array([0.05, 0.95])
    width = np.ptp(plain.analysis.limit.quantile(ends))
    assert mended.analysis.limit.quantile(ends) == pytest.approx(
        plain.analysis.limit.quantile(ends), abs=0.3 * width
    )


def test_they_are_filled_in_before_periods_are_averaged() -> None:
    bench = Bench.from_device("lhifam")
    clean = recorded_on(bench, Multisine(bench.force_rms, 1.0, 200.0, 0.5, 3), seed=2)
    plain, mended = estimate_etfe(clean), estimate_etfe(struck(clean, 4, 20.0))
    assert [n.topic for n in mended.notices].count("wild samples") == 1
    assert np.sum(mended.variance) < 1.1 * np.sum(plain.variance)
