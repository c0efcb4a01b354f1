"""Closed loops with noise that was added to the command: they are read through its innovations."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.models import build_model
from bayeshaptic.recordings import join_recordings, recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.band import driven_range
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.recordings.signals.added_noise import command_innovations
from bayeshaptic.recordings.through_reference import through_reference, too_weak
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, run_loop
from bayeshaptic.types import Floats

SECONDS = 12.0


def bench_of(name: str, wander: float) -> Bench:
    """A held device whose hand moves it more than the command does."""
    bench = Bench.from_device(name, True, "grasped")
    return replace(bench, wander_rms=wander * bench.force_rms)


def dithered(bench: Bench, seed: int, filtered: float = 0.0) -> tuple[Recording, Floats]:
    """A PD controller that holds a place, and the noise that is added to its command."""
    rng, count = np.random.default_rng(seed), round(SECONDS / bench.period_s)
    noise = bench.force_rms * rng.standard_normal(count)
    stiffness = 0.1 * bench.true_critical_stiffness()
    mass = sum(value for name, value in bench.values.items() if name.startswith("m"))
    damping = 0.6 * np.sqrt(stiffness * mass)
    now = {"position": 0.0, "rate": 0.0}

    def control(k: int, position: float) -> float:
        rate = (position - now["position"]) / bench.period_s
        now["rate"] = filtered * now["rate"] + (1 - filtered) * rate
        now["position"] = position
        return float(noise[k] - stiffness * position - damping * now["rate"])

    done = run_loop(bench, control, SECONDS, seed=seed)
    return recording_from_arrays(done.force, done.position, bench.period_s), noise


@pytest.mark.parametrize("filtered", [0.0, 0.8])
def test_the_innovations_of_a_command_are_what_was_added_to_it(filtered: float) -> None:
    recording, noise = dithered(bench_of("lhifam", 1.0), 1, filtered)
    found = command_innovations(recording)
    assert found is not None
    assert np.std(found) < 0.9 * np.std(recording.force)  # of which the controller made the rest
    left = (found - noise)[100:]
    # 42 numbers were fitted to so many samples.
    assert np.var(left) < 3 * 42 / len(noise) * np.var(noise)


def test_pieces_have_one_law() -> None:
    recording, noise = dithered(bench_of("lhifam", 1.0), 1)
    half = recording.samples // 2
    both = join_recordings([recording.part(0, half), recording.part(half, recording.samples)])
    found = command_innovations(both)
    assert found is not None
    inside = np.delete(np.arange(len(noise)), np.r_[:20, half : half + 20])
    assert np.var((found - noise)[inside]) < 3 * 42 / len(noise) * np.var(noise)


def test_a_command_that_its_past_foretells_has_none() -> None:
    bench = bench_of("lhifam", 1.0)
    slow = np.cumsum(np.random.default_rng(2).standard_normal((2, 12_000)), axis=1)
    still = recording_from_arrays(np.cumsum(slow[0]), slow[1], bench.period_s)
    assert command_innovations(still) is None


@pytest.mark.parametrize("name", ["lhifam", "phantom"])
def test_a_hand_that_wanders_in_a_loop_biases_nothing(name: str) -> None:
    """Twice the log likelihood between the best fit and the truth is chi-square."""
    excess = []
    for seed in range(8):
        bench = bench_of(name, 1.0)
        recording, _ = dithered(bench, seed)
        etfe = estimate_etfe(replace(recording, reference=command_innovations(recording)))
        assert etfe.moved_throughout
        model = build_model("grasped", name, delay_s=bench.delay_s)
        theta = np.array([bench.values[parameter] for parameter in model.names])
        there = summarise(model, compress(etfe, partial(model.response, theta)), theta)
        best = polish(model, there.windows, theta)
        excess.append(2 * (there.likelihood(best[None])[0] - there.log_likelihood))
    # Eleven parameters each: 5 of a thousand such sums are larger.
    assert np.sum(excess) < 127


def test_a_held_device_has_its_limit() -> None:
    """The direct method is biased there: the hand's motion peaks within its lowest windows."""
    bench = bench_of("lhifam", 1.0)
    recording, _ = dithered(bench, 3)
    closed = close_loop(recording, device="lhifam", held=True)
    assert closed.analysis.etfe.moved_throughout
    low, high = closed.analysis.limit.quantile(np.array([0.005, 0.995]))
    truth = bench.true_critical_stiffness()
    told = headline(closed)
    assert low < truth < high and told.stiffness is not None and told.stiffness < truth


def test_innovations_that_are_too_weak_leave_all_as_it_was() -> None:
    """A reference that somebody wrote down, and that does not help, is spoken of."""
    recording, noise = dithered(bench_of("lhifam", 1.0), 1)
    before = (Notice("warning", "feedback", "The force was computed from the motion."),)
    read, after = through_reference(recording, before)
    assert read.reference is not None and after != before
    assert too_weak(before, after, "few windows") == before
    _, after = through_reference(replace(recording, reference=noise), before)
    assert [notice.topic for notice in too_weak(before, after, "few")] == ["feedback", "reference"]


def test_a_reference_that_moves_the_slow_alone_is_not_everywhere() -> None:
    recording, noise = dithered(bench_of("lhifam", 0.1), 1)
    lines = np.fft.rfft(noise)
    lines[round(50.0 * SECONDS) :] = 0.0  # above 50 Hz
    slow = np.fft.irfft(lines, len(noise)) + 1e-3 * np.random.default_rng(4).normal(size=len(noise))
    etfe = estimate_etfe(replace(recording, reference=slow))
    assert etfe.through_reference and not etfe.moved_throughout


def test_a_notch_in_the_force_is_no_end_of_its_band() -> None:
    """A controller with a delay: 20 dB at 120 Hz, -6 dB at 65 Hz and 9 dB below 20 Hz."""
    frequency = np.arange(1.0, 400.0)
    level = np.interp(frequency, [1, 20, 65, 120, 160, 400], [9, 9, -6, 20, 12, 3])
    assert driven_range(frequency, 10 ** (level / 10)) == (0, 398)
    cut = np.where(frequency < 65, -6 - 40 * np.log2(65 / frequency), level)
    low, high = driven_range(frequency, 10 ** (cut / 10))
    assert 50 < frequency[low] < 80 and high == 398
