"""Which signal drives which, on simulated and on measured recordings.

Error rates over hundreds of recordings are in `benchmarks/door.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, chirp, filtfilt, lfilter, sosfilt
from tiny_bench import CASES, CRITICAL, PERIOD, SCALE, band_noise, record, relay

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.checks.what_drives_what import what_drives_what
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.join import join_recordings
from bayeshaptic.recordings.read import read_recording
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.causality.causality import (
    NOTABLE_SHARE,
    Causality,
    Share,
    causality,
)
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.recordings.signals.switching import is_switched
from bayeshaptic.rig import Bench, WhiteNoise, run_loop, simulate
from benchmarks.strangers.loops import make

SAMPLES = 12_000
BANDS = (100.0, 200.0, 300.0, 500.0)


def judge(force: np.ndarray, position: np.ndarray) -> Causality:
    return causality(recording_from_arrays(force, position, period_s=PERIOD))


@cache
def open_loops(case: str) -> tuple[np.ndarray, np.ndarray]:
    """Eight recordings: four bands, two shapes of band edge; friction in the second four."""
    rng = np.random.default_rng(CASES.index(case))
    scale = SCALE[case.split()[0]]
    noise = np.concatenate([band_noise(rng, (2, SAMPLES), band) for band in BANDS])
    friction = scale["friction"] * (np.arange(8) >= 4)
    return record(case, scale["rms"] * noise, rng, friction=friction)


@pytest.mark.parametrize("case", CASES)
def test_no_false_alarm_in_open_loop(case: str) -> None:
    for force, position in zip(*open_loops(case), strict=True):
        found = judge(force, position)
        assert not (found.has_feedback or found.swapped or found.early_position or found.opposite)
        # Half of the alarm's threshold: it is not by luck.
        assert not found.doubtful
        assert found.feedback[1].value < 0.01
        assert found.answer.value > 0.04


def test_sweeps_whose_period_is_no_whole_number_of_samples_are_no_feedback() -> None:
    """With ten stretches for the cross-fit this one may be, with forty not; both must say so."""
    bench, period_s = Bench.from_device("lhifam", False, "free"), 4.1134
    time_s = np.arange(int(5 * period_s / PERIOD)) * PERIOD
    sweep = chirp(time_s % period_s, 0.5, period_s, 300.0)
    made = simulate(bench, bench.force_rms * np.sqrt(2) * sweep)
    found = judge(made.force, made.position)
    assert not found.has_feedback
    assert not found.doubtful


@pytest.mark.parametrize("case", CASES)
def test_swapped_columns_are_seen(case: str) -> None:
    for force, position in zip(*open_loops(case), strict=True):
        found = judge(position, force)
        assert found.swapped
        assert not found.has_feedback


@pytest.mark.parametrize("case", CASES)
def test_a_position_recorded_a_sample_early_is_no_feedback(case: str) -> None:
    for force, position in zip(*open_loops(case), strict=True):
        found = judge(force[:-1], position[1:])
        assert not (found.has_feedback or found.swapped)
    # White force on the first mass: its answer within the sample is plain for the heavy device,
    # and hidden by the coarse encoder of the light one.
    if case.startswith("lhifam"):
        force, position = (signal[-1] for signal in open_loops(case))
        assert judge(force[:-1], position[1:]).early_position


def test_noise_of_a_band_is_told_from_a_loop_by_its_own_far_past() -> None:
    """Its far past is in the position, and nothing else of the position tells of it."""
    rng = np.random.default_rng(11)
    edges = butter(2, [8.0, 300.0], "band", fs=1 / PERIOD, output="sos")
    noise = sosfilt(edges, rng.standard_normal((2, SAMPLES)))
    case = CASES[0]
    scale = SCALE[case.split()[0]]
    for force, position in zip(*record(case, scale["rms"] * noise, rng), strict=True):
        found = judge(force, position)
        assert not found.has_feedback or found.far_past
        assert not (found.swapped or found.opposite)


@pytest.mark.parametrize("case", CASES)
def test_virtual_walls_and_servos_are_feedback(case: str) -> None:
    rng = np.random.default_rng(7)
    scale, critical = SCALE[case.split()[0]], CRITICAL[case]
    excitation = scale["rms"] * band_noise(rng, (4, SAMPLES), 300.0)
    stiffness = critical * np.array([0.03, 0.1, 0.5, 0.05])
    damping = np.array([0.0, 0.0, 0.0, critical * 4e-4])

    def control(k: int, position: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        speed = (position[:, k] - position[:, max(k - 1, 0)]) / PERIOD
        return wanted - stiffness * position[:, k] - damping * speed

    for force, position in zip(*record(case, excitation, rng, control=control), strict=True):
        found = judge(force, position)
        assert found.has_feedback
        assert not found.swapped


@pytest.mark.parametrize("case", CASES)
def test_pieces_are_not_foretold_by_the_pieces_before(case: str) -> None:
    """Across their joints a fifth of open loops was feedback, and loops were none."""
    rng = np.random.default_rng(11)
    scale, critical = SCALE[case.split()[0]], CRITICAL[case]
    count, each = 6, 1500
    excitation = scale["rms"] * band_noise(rng, (4 * count, each), 300.0)
    share = np.repeat([0.0, 0.0, 0.1, 0.3], count)

    def control(k: int, position: np.ndarray, wanted: np.ndarray) -> np.ndarray:
        return wanted - critical * share * position[:, k]

    made = record(case, excitation, rng, control=control)
    ways = [signal.reshape(4, count, each) for signal in made]
    for number, (force, position) in enumerate(zip(*ways, strict=True)):
        pieces = [
            recording_from_arrays(*one, period_s=PERIOD)
            for one in zip(force, position, strict=True)
        ]
        found = causality(join_recordings(pieces))
        assert found.doubt == (0 if number < 2 else 2)


def test_a_position_that_was_smoothed_with_later_samples_is_named_beside_feedback() -> None:
    """It knows the force before that acts; in one of open loop, too."""
    force = np.random.default_rng(4).standard_normal(20_000)
    speed = lfilter([0, 1], [1, -0.998], force)
    position = filtfilt(*butter(2, 0.2), lfilter([1], [1, -0.9999], speed))
    recording = recording_from_arrays(force, position, 1e-3)
    found = what_drives_what(recording, rough_response(recording), "a file")
    (notice,) = (one for one in found if one.topic == "feedback")
    assert notice.level == "warning" and "filtfilt" in notice.text


def test_a_spring_that_a_hand_leads_is_not_taken_for_exchanged_columns() -> None:
    """Its past positions tell the command, and no command the motion, which is as smooth."""
    rng = np.random.default_rng(8)
    position = np.round(np.cumsum(band_noise(rng, (1, SAMPLES), 5.0)[0]), 2)
    found = judge(1.0 - 2.0 * position, position)
    # As it is found where the hand moves the device and the command hardly does.
    led = replace(found, feedback=(Share(0.5, 20.0),) * 3, answer=Share(0.0, 0.0))
    assert led.has_feedback and not led.swapped
    force, position = (signal[0] for signal in open_loops("lhifam grasped"))
    exchanged = judge(position, force)
    led = replace(exchanged, feedback=led.feedback, answer=led.answer)
    assert led.swapped and not led.has_feedback


def servo(where: str, ahead: int) -> tuple[np.ndarray, np.ndarray]:
    """Steps under a PD controller of 5 Hz, with dry friction, and where the position is logged.

    The command is made from the position of its own sample, or from the one before.
    """
    bench = Bench.from_device("lhifam", mechanism="rigid").with_effect("coulomb_friction")
    mass, omega, before = bench.values["m"], 2 * np.pi * 5.0, [0.0, 0.0, 0.0]
    wanted = 0.002 * np.repeat(np.random.default_rng(3).normal(size=20), 250)

    def control(k: int, position: float) -> float:
        before.append(position)
        now, last = (before[-1], before[-2]) if where == "now" else (before[-2], before[-3])
        return mass * omega * (omega * (wanted[k] - now) - 1.4 * (now - last) / bench.period_s)

    made = run_loop(bench, control, 5.0, seed=1)
    force, position = made.force, made.position
    return force[max(-ahead, 0) : len(force) - max(ahead, 0)], position[
        max(ahead, 0) : len(position) - max(-ahead, 0)
    ]


@pytest.mark.parametrize("ahead", [-1, 0, 1])
@pytest.mark.parametrize("where", ["now", "before"])
def test_steps_under_a_controller_are_feedback(where: str, ahead: int) -> None:
    found = judge(*servo(where, ahead))
    assert found.has_feedback
    assert not (found.swapped or found.opposite or found.early_position or found.far_past)


@pytest.mark.parametrize("case", CASES)
def test_a_position_of_the_opposite_sign_is_seen(case: str) -> None:
    # In a force of a fifth of the band is next to nothing new that could be answered to.
    for force, position in zip(*(signals[4:] for signals in open_loops(case)), strict=True):
        assert judge(force, -position).opposite


def test_news_say_nothing_of_the_sign_where_a_force_repeats() -> None:
    """Of 23 strangers' multisines one of the right sign was refused: their responses tell all."""
    force, position = (signals[-1] for signals in open_loops("lhifam free"))
    found = judge(force, -position)
    assert found.opposite
    assert not replace(found, repeats=True).opposite


@pytest.mark.parametrize("excitation", ["smooth", "steps"])
def test_the_opposite_sign_is_seen_in_a_force_with_nothing_new(excitation: str) -> None:
    """The phase of the response contradicts its slope; with the right sign it does not."""
    bench, rng = Bench.from_device("phantom", held=True), np.random.default_rng(4)
    if excitation == "steps":
        force: Any = bench.force_rms * np.repeat(rng.normal(size=120), 100)
    else:
        force = WhiteNoise(bench.force_rms, 25.0, 0.5, 12.0)
    made = simulate(bench, force, seed=2)
    right = recording_from_arrays(**made.signals)
    wrong = replace(right, position=-right.position)
    assert not rough_response(right).opposite(bench.period_s)
    assert rough_response(wrong).opposite(bench.period_s)
    try:  # a controller's force goes against the motion, too: what is known is said either way
        told = " ".join(notice.text for notice in check_recording(wrong))
    except InputError as error:
        told = str(error)
    assert "opposite sign" in told


def test_a_command_that_is_mostly_at_its_limits_cannot_be_decided() -> None:
    force, position = (signal[0] for signal in open_loops("lhifam free"))
    limit = np.quantile(np.abs(force), 0.4)
    found = judge(np.clip(force, -limit, limit), position)
    assert found.doubtful
    assert "at its limits in 60 %" in found.evidence


def test_a_relay_is_feedback_and_a_binary_sequence_is_not() -> None:
    rng = np.random.default_rng(8)
    case = "lhifam free"
    bits = 3.0 * np.repeat(rng.choice([-1.0, 1.0], (1, SAMPLES // 10)), 10, axis=1)
    force, position = record(case, bits, rng)
    assert not judge(force[0], position[0]).relay

    force, position = record(case, bits, rng, control=relay)
    found = judge(force[0], position[0])
    assert found.relay
    assert found.has_feedback


def about(bench: Bench, reach: float, hysteresis: float, seconds: float = 8.0) -> Recording:
    """A relay about one set point and, half-way, about that on the other side."""
    half, force = round(seconds / bench.period_s) // 2, 3 * bench.force_rms

    def controller(k: int, position: float) -> float:
        nonlocal force
        off = position - (reach if k < half else -reach)
        if abs(off) > hysteresis:
            force = -np.sign(off) * abs(force)
        return float(force)

    return recording_from_arrays(**run_loop(bench, controller, seconds, seed=5).signals)


@pytest.mark.parametrize("hysteresis", [0.0, 0.01])
def test_a_relay_about_a_set_point_that_changes_is_refused(hysteresis: float) -> None:
    recording = about(Bench.from_device("phantom"), 0.3, hysteresis)
    with pytest.raises(InputError, match="bayeshaptic relay"):
        check_recording(recording)


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
def test_no_binary_force_in_open_loop_is_a_relay(device: str) -> None:
    rng = np.random.default_rng(12)
    time = np.arange(6000) * PERIOD
    binary = [np.repeat(rng.choice([-1.0, 1.0], 6000 // hold), hold) for hold in range(1, 9)]
    binary += [np.where((time * hz) % 1 < 0.5, 1.0, -1.0) for hz in (3.3, 17.0, 71.3)]
    binary += [np.sign(chirp(time, 5.0, 6.0, 40.0) + 1e-9)]
    for held in (False, True):
        bench = Bench.from_device(device, held=held)
        for seed, force in enumerate(binary):
            made = simulate(bench, 2 * bench.force_rms * force, seed=seed)
            assert not is_switched(made.signals["force"], made.signals["position"])


def test_a_force_that_repeats_exactly_is_no_feedback() -> None:
    # More lines than the prediction has lags: the device's memory helps to tell the phase.
    rng = np.random.default_rng(9)
    force = np.tile(rng.normal(size=80), SAMPLES // 80)
    force, position = record("lhifam free", 3.0 * force[None], rng)
    found = judge(force[0], position[0])
    assert found.removed > NOTABLE_SHARE
    assert found.repeats
    assert not found.has_feedback
    noisy = force[0] + 1e-3 * rng.normal(size=SAMPLES)
    assert not judge(noisy, position[0]).repeats


def test_noise_of_a_force_sensor_under_a_multisine_is_no_feedback() -> None:
    """Past it the position knows what was commanded; what a controller does not repeat answers."""
    rng = np.random.default_rng(9)
    lines = np.zeros(701, complex)
    lines[1:200] = np.exp(2j * np.pi * rng.random(199))
    once = np.fft.irfft(lines, 1400)
    command = np.resize(once / once.std(), 9000)
    force, position = record("lhifam free", 3.0 * command[None], rng)
    sensed = force[0] + 0.05 * force[0].std() * rng.normal(size=force.shape[1])
    assert not judge(sensed, position[0]).doubt
    place, velocity, before = 0.0, 0.0, 0.0
    closed = np.zeros((2, 9000))
    for k, reference in enumerate(0.05 * command):
        seen = 1e-5 * np.round(place / 1e-5)
        push = 400.0 * (reference - seen) - 5.0 * (seen - before) / 1e-3
        closed[:, k], before = (push, seen), seen
        velocity += (push + 0.1 * rng.normal() - 0.5 * velocity) / 0.5 * 1e-3
        place += velocity * 1e-3
    assert judge(closed[0], closed[1]).has_feedback


def test_signals_of_other_people_are_neither_feedback_nor_swapped() -> None:
    force, position = open_loops("lhifam grasped")
    found = judge(force[6], position[7])
    assert not (found.has_feedback or found.swapped)
    assert abs(found.answer.value) < 0.02


@pytest.mark.parametrize("gain", [0.0, 0.08])
def test_an_answer_of_less_than_a_hundredth_of_the_force_is_seen(gain: float) -> None:
    """White noise on a loop: expected chi-square N gain^2 and some 7 by chance, so 135 and 7."""
    rng = np.random.default_rng(4)
    added, noise = rng.standard_normal((2, 20_000))
    force, position = np.zeros((2, len(added)))
    for k in range(2, len(added)):
        position[k] = 0.9 * position[k - 1] + 0.3 * force[k - 1] + noise[k]
        force[k] = added[k] - gain * noise[k - 1]
    found = judge(force, position)
    assert all(share.value < 0.01 for share in found.feedback)
    assert found.has_feedback is (gain > 0)
    assert not (gain == 0 and found.doubtful)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_units_do_not_matter(factor: float) -> None:
    force, position = (signal[0] for signal in open_loops("phantom free"))
    one, other = judge(force, position), judge(factor * force, position / factor + 5 / factor)
    assert other.answer.value == pytest.approx(one.answer.value, rel=1e-3)


@pytest.mark.parametrize("samples", [1000, 3000])
def test_short_recordings(samples: int) -> None:
    force, position = (signal[7, :samples] for signal in open_loops("lhifam grasped"))
    assert not judge(force, position).has_feedback
    assert judge(position, force).swapped


def test_the_measured_servo_is_feedback(measured: Callable[[str], Path]) -> None:
    columns = "time=t,force=vir*35.15[N],position=qm[m]"
    found = causality(read_recording(measured("emps/DATA_EMPS.mat"), columns))
    assert found.has_feedback
    assert found.same_sample.value < -0.3


def test_the_measured_bench_is_open_loop(measured: Callable[[str], Path]) -> None:
    path = measured("two_mass_bench/MultisineTypeA.mat")
    columns = "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]"
    found = causality(read_recording(path, columns))
    assert not (found.has_feedback or found.swapped or found.early_position)
    assert found.answer.value > 0.3
    swapped = "time=time*1e-6,force=theta_mx[N],position=iq_refx[m]"
    assert causality(read_recording(path, swapped)).swapped


def a_motor(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Torque and speed of a mass with a damper under binary noise, 50 times a second."""
    rng = np.random.default_rng(4)
    force = np.repeat(rng.choice([-1.0, 1.0], 300), 5)
    left = np.exp(-0.02 / 0.036)  # of the speed after a sample
    speed = lfilter([0.0, 0.0, 1 - left], [1.0, -left], force)
    return force, speed + noise * rng.normal(size=len(speed))


def test_a_speed_is_no_position() -> None:
    """A stiffness was recommended of it, of two masses 34,000 times apart, in green."""
    force, speed = a_motor(0.01)
    with pytest.raises(InputError, match=r"looks like a velocity.*velocity=NAME\[rad/s\]"):
        check_recording(recording_from_arrays(force, speed, period_s=0.02, position_unit="rad"))
    position = np.cumsum(speed) * 0.02
    check_recording(recording_from_arrays(force, position, period_s=0.02, position_unit="rad"))


@pytest.mark.parametrize("seed", [80056, 95055])
def test_a_few_pulses_of_a_spring_and_a_damper_are_no_velocity(seed: int) -> None:
    """The lower frequencies of a position look like those of a damper and a mass's velocity."""
    case = make(seed)
    assert case is not None
    recording = case.recording
    rough = rough_response(recording)
    assert rough.is_velocity(recording.period_s)
    what_drives_what(recording, rough, "it")  # refuses what looks like a velocity


@pytest.mark.parametrize("held", [False, True])
def test_a_device_that_swings_back_does_not_move_against_the_force(held: bool) -> None:
    """Without the slow motion its late answer is the backward swing, and the largest."""
    bench = Bench.from_device("lhifam", held, "grasped" if held else "free")
    made = simulate(bench, WhiteNoise(bench.force_rms, 300.0, 53.0, 15.0), seed=1)
    recording = recording_from_arrays(made.force, made.position, bench.period_s)
    found = causality(recording)
    assert found.answers[-1].value < -max(share.value for share in found.answers[:-1])
    assert not found.opposite
    what_drives_what(recording, rough_response(recording), "it")  # refuses what is turned round
