"""What encoder, clock and logger do to a recording: found in the samples, and mended."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from linear_bench import LHIFAM_HELD, Device
from on_the_bench import recorded_on
from scipy.linalg import expm
from scipy.signal import butter, chirp, lfilter

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.base.direct import opened_directly
from bayeshaptic.diagnosis.base.opened import opened
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.samples.clipped import clipped
from bayeshaptic.diagnosis.samples.faults import faults
from bayeshaptic.diagnosis.samples.mend import Inspection, inspect, repair_measurement
from bayeshaptic.diagnosis.samples.prediction import as_recorded
from bayeshaptic.diagnosis.samples.repeated import held
from bayeshaptic.diagnosis.samples.tones import find_tones
from bayeshaptic.diagnosis.state import State
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.filling import _regression
from bayeshaptic.rig import Bench, Multisine, WhiteNoise, run_loop, simulate
from bayeshaptic.stability import critical_stiffness

SECONDS, SEED = 8.0, 4
PHANTOM = Bench.from_device("phantom")
LHIFAM = Bench.from_device("lhifam", held=True)  # fine counts, and a hand that keeps it in place
COUNT = PHANTOM.encoder_resolution


def recorded(bench: Bench, seed: int = SEED) -> Recording:
    """Eight seconds; the declared count is that of the device."""
    return recorded_on(bench, WhiteNoise(0.5 * bench.force_rms, 200.0, 0.7, SECONDS), seed=seed)


def fitted(recording: Recording, bench: Bench) -> tuple[Etfe, Fit]:
    etfe = estimate_etfe(recording, (0.7, 200.0))
    assert bench.device is not None
    return etfe, least_squares(build_model(bench.mechanism, bench.device), etfe)


@cache
def looked_at(
    name: str, lhifam: bool = False, **fields: Any
) -> tuple[Recording, Etfe, Fit, Inspection]:
    """A recording with one effect (or none), and what its samples show."""
    plain = LHIFAM if lhifam else PHANTOM
    bench = plain.with_effect(name, **fields) if name else plain
    recording = recorded(bench)
    etfe, fit = fitted(recording, bench)
    return recording, etfe, fit, inspect(recording, fit, etfe)


def flagged(look: Inspection) -> dict[str, Any]:
    return {finding.effect.name: finding for finding in look.findings if finding.flagged}


@cache
def clean_position(lhifam: bool = False) -> np.ndarray:
    return recorded(LHIFAM if lhifam else PHANTOM).position


def test_a_clean_recording_is_left_as_it_is() -> None:
    recording, etfe, fit, look = looked_at("")
    assert flagged(look) == {}
    assert np.array_equal(look.mended.position, recording.position) and look.measured == 1.0
    state = State(etfe, fit)
    assert repair_measurement(state) is state


def test_coarse_counts_are_measured_and_nothing_is_changed() -> None:
    recording, etfe, fit, look = looked_at("quantisation", count=8 * COUNT)
    (name, finding), *others = flagged(look).items()
    assert (name, others) == ("quantisation", [])
    # Positions are written as multiples of the count: it comes out to rounding.
    assert finding.estimates["resolution"].mean == pytest.approx(8 * COUNT, rel=1e-6)
    assert look.mended.encoder_resolution == pytest.approx(8 * COUNT, rel=1e-6)
    assert np.array_equal(look.mended.position, recording.position)


def test_coarser_counts_than_said_leave_the_posterior_as_it_was() -> None:
    recording = looked_at("quantisation", count=8 * COUNT)[0]
    closed = close_loop(recording, "free", device=PHANTOM.device, ess=100, hidden=False)
    assert closed.effect_names == ("quantisation",)
    assert closed.analysis.posterior is closed.base.posterior
    recorded_with = [one.etfe.recording for one in (closed.base, closed.analysis)]
    said, found = (one.encoder_resolution for one in recorded_with if one is not None)
    assert (said, found) == (COUNT, pytest.approx(8 * COUNT))


@pytest.mark.parametrize("seed", range(4))
def test_a_motion_of_less_than_a_count_a_sample_has_lost_no_rows(seed: int) -> None:
    """Jumps by a count were taken for rows that are missing, and what was put back for jitter."""
    force = np.random.default_rng(seed).standard_normal(8000)
    motion = lfilter(*butter(2, 0.04), force)
    counts = np.round(0.1 * motion / np.std(np.diff(motion)))
    assert faults(as_recorded(recording_from_arrays(force, counts, 1e-3))).lost == 0


def test_a_wild_sample_is_found_where_nothing_that_is_left_tells_of_the_force() -> None:
    """Beside pulses whose samples are all known to be wrong: the force has no visible effect."""
    rng = np.random.default_rng(4)
    starts = np.cumsum(rng.integers(200, 1500, size=40))
    force = np.zeros(starts[-1] + 1500)
    for start in starts:
        force[start : start + 3] = rng.choice([-1.0, 1.0])
    position = lfilter([0.0, 0.0, 0.5, 0.5], np.convolve([1, -1], [1, -0.99]), force)
    position = np.round(300 * position)
    wild = int(starts[9] + starts[10]) // 2
    position[wild] += 300
    recording = recording_from_arrays(force, position, 1e-3)
    struck = np.convolve(force != 0, np.ones(6))[: len(force)] > 0
    found = faults(as_recorded(recording).without(struck))
    assert found.lost == 0 and list(np.flatnonzero(found.wild)) == [wild]


def rubbing(seed: int, samples: int = 20000) -> tuple[np.ndarray, np.ndarray]:
    """White force on two masses of which the motor's rubs; no noise."""
    force = np.random.default_rng(seed).standard_normal(samples)
    motor, load, stiffness, fine, friction = 0.15, 0.85, 1.3e-3, 20, 0.2
    system = np.zeros((5, 5))
    system[0, 2] = system[1, 3] = 1.0
    system[2] = [-stiffness / motor, stiffness / motor, -5e-3, 0, 1 / motor]
    system[3, :2] = stiffness / load, -stiffness / load
    moves = expm(system / fine)[:4]
    state, position = np.zeros(4), np.empty(samples)
    for k in range(samples):
        position[k] = state[0]
        for _ in range(fine):
            state = moves @ np.append(state, force[k])
            rub = np.clip(-state[2] / moves[2, 4], -friction, friction)
            state = state + rub * moves[:, 4]
    return force, position


@pytest.mark.parametrize("seed", range(2))
def test_rows_that_are_put_back_had_a_force_that_was_commanded(seed: int) -> None:
    """Rows that were there were put back twice, with forces of twenty times the largest."""
    force, position = rubbing(seed)
    lost = np.random.default_rng(seed).choice(np.arange(100, len(force) - 100), 20, replace=False)
    force, position = np.delete(force, lost), np.delete(position, lost)
    found = faults(as_recorded(recording_from_arrays(force, 1e-3 * position, 1e-3)))
    put_back = found.samples.recording.force
    assert np.ptp(put_back) == pytest.approx(np.ptp(force), rel=1e-9)
    assert 15 <= found.lost <= 26


def test_a_mains_tone_is_sized_and_subtracted() -> None:
    amplitude = 2e-3
    recording, etfe, fit, look = looked_at("mains_tone", amplitude=amplitude, frequency_hz=50.0)
    finding = flagged(look)["mains_tone"]
    frequency, size = (finding.estimates[key] for key in ("frequency_1_hz", "amplitude_1"))
    # Within four of its own standard deviations, and of the right size for eight seconds.
    assert abs(frequency.mean - 50.0) < max(4 * frequency.sd, 0.01) and frequency.sd < 0.05
    assert abs(size.mean - amplitude) < max(4 * size.sd, 0.02 * amplitude)
    # What is left of the tone: the line at 50 Hz, before and after, without the device's motion.
    clean = clean_position()
    wave = np.exp(-2j * np.pi * 50.0 * np.arange(len(clean)) * recording.period_s)
    left = [
        2 * abs(np.mean((p - clean) * wave)) for p in (recording.position, look.mended.position)
    ]
    assert left[0] == pytest.approx(amplitude, rel=0.05) and left[1] < 0.1 * amplitude


@pytest.mark.parametrize("probability", [0.002, 0.02])
def test_held_samples_are_counted_and_filled_in(probability: float) -> None:
    recording, etfe, fit, look = looked_at(
        "held_samples", lhifam=True, probability=probability, longest=3
    )
    finding = flagged(look)["held_samples"]
    clean = clean_position(lhifam=True)
    wrong = recording.position != clean
    assert wrong.any()
    # A held sample that the next one equals by chance cannot be seen, and does no harm.
    assert finding.estimates["share"].mean == pytest.approx(wrong.mean(), rel=0.25)
    error = [
        np.sqrt(np.mean((p - clean)[wrong] ** 2))
        for p in (recording.position, look.mended.position)
    ]
    assert error[1] < 0.3 * error[0]
    # And next to nothing of what was right is touched.
    assert np.mean(look.mended.position[~wrong] != clean[~wrong]) < 0.01


@pytest.mark.parametrize("bench", [PHANTOM, Bench.from_device("lhifam")], ids=["phantom", "lhifam"])
@pytest.mark.parametrize(("period_s", "seed"), [(1e-3, 1), (1e-3, 2), (2e-4, 1)])
def test_a_reading_that_hung_is_filled_in_to_its_end(
    bench: Bench, period_s: float, seed: int
) -> None:
    """What looked right in between was left, the jump at the end taken for a new zero.

    A motion of less than a count a sample hid all of it.
    """
    bench = replace(bench, period_s=period_s)
    made = simulate(bench, WhiteNoise(0.5 * bench.force_rms, 200.0, 0.7, SECONDS), seed=seed)
    position, first, rows = made.position.copy(), round(3 / period_s), round(0.1 / period_s)
    hung = slice(first, first + rows)
    position[hung] = position[first]
    count = bench.encoder_resolution
    recording = recording_from_arrays(
        **made.signals | {"position": position}, encoder_resolution=count
    )
    assert not [notice for notice in recording.notices if notice.topic == "jumps"]
    wrong, statistic = held(as_recorded(recording))
    gone = np.abs(made.position - position)
    assert gone.max() > 50 * count  # it could be seen
    assert statistic > 0.5 * rows
    assert wrong[hung].sum() > 0.9 * rows and wrong.sum() <= wrong[hung].sum() + 5
    filled = as_recorded(recording).without(wrong).position
    assert np.abs(filled - made.position).max() < 4 * count


def test_under_feedback_the_longest_part_is_fitted_in_which_nothing_hung() -> None:
    """A controller answers to what it reads; what is not filled in made the limit too high."""
    bench = Bench.from_device("lhifam")
    read, hangs = np.zeros(8001), [slice(2000, 2150), slice(6000, 6200)]
    wanted = lfilter([0.1], [1, -0.9], np.random.default_rng(3).normal(size=len(read)))

    def control(k: int, position: float) -> float:
        for rows in hangs:
            if rows.start < k < rows.stop:
                position = read[rows.start]
        read[k] = position
        return float(4000 * (2e-3 * wanted[k] - position))

    made = run_loop(bench, control, 8.0, seed=2)
    recording = recording_from_arrays(made.force, read[: len(made.force)], period_s=1e-3)
    directly = opened_directly(opened(recording, "free", Options()), Options())
    assert directly is not None and directly.etfe.recording is not None
    assert directly.etfe.recording.samples == pytest.approx(3850, abs=5)
    (said,) = [notice.text for notice in directly.notices if notice.topic == "jumps"]
    assert said.startswith("The position hangs 2 times")


def test_clipping_is_found_at_its_limits_and_filled_in() -> None:
    limit = float(np.quantile(np.abs(clean_position(lhifam=True)), 0.93))
    recording, etfe, fit, look = looked_at("position_clipping", lhifam=True, limit=limit)
    finding = flagged(look)["position_clipping"]
    cut = np.abs(clean_position(lhifam=True)) > limit
    assert finding.estimates["share"].mean == pytest.approx(cut.mean(), rel=0.1)
    ends = sorted(abs(e.mean) for key, e in finding.estimates.items() if key.startswith("limit"))
    assert ends == pytest.approx([limit] * len(ends), abs=LHIFAM.encoder_resolution)
    assert look.measured == pytest.approx(1 - cut.mean(), abs=0.02)


def test_jitter_is_sized_but_stays_a_finding() -> None:
    recording, etfe, fit, look = looked_at("sample_jitter", sd_s=1e-4)
    finding = flagged(look)["sample_jitter"]
    estimate = finding.estimates["sd_s"]
    assert abs(estimate.mean - 1e-4) < max(4 * estimate.sd, 2e-5)
    assert not finding.mended


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("mains_tone", {"amplitude": 5e-5, "frequency_hz": 50.0}),
        ("held_samples", {"probability": 0.02, "longest": 3}),
    ],
)
def test_mending_brings_the_fit_back_to_the_noise(name: str, fields: dict[str, Any]) -> None:
    _, etfe, fit, _ = looked_at(name, lhifam=True, **fields)
    mended = repair_measurement(State(etfe, fit))
    assert [effect.name for effect in mended.accepted] == [name]
    truth = LHIFAM.true_critical_stiffness()
    limit = critical_stiffness(mended.fit.model, mended.fit.theta).value
    # The clean recording's own estimate is within 1 % (eight seconds): two to be sure.
    assert limit == pytest.approx(truth, rel=0.02)
    # The reduced chi-square of some 60 windows of three complex numbers scatters by 0.1.
    assert mended.fit.reduced_chi_square < 1.5


def test_what_is_known_is_not_found_twice() -> None:
    _, etfe, fit, _ = looked_at("held_samples", lhifam=True, probability=0.02, longest=3)
    once = repair_measurement(State(etfe, fit))
    twice = repair_measurement(replace(once, etfe=replace(once.etfe)))
    assert [effect.name for effect in twice.accepted] == ["held_samples"]


@pytest.mark.parametrize("friction", [0.1, 0.3])
@pytest.mark.parametrize("bench", [PHANTOM, Bench.from_device("lhifam", mechanism="rigid")])
def test_a_pause_at_the_target_is_no_clipping(bench: Bench, friction: float) -> None:
    """Steps under PD: the force changes while friction holds the device at the target."""
    sticky = bench.with_effect("coulomb_friction", force=friction * bench.force_rms)
    mass = sum(value for name, value in bench.values.items() if name.startswith("m"))
    stiffness, damping = mass * 25.0**2, 1.4 * mass * 25.0
    size, before = 2 * bench.force_rms / stiffness, 0.0

    def control(k: int, position: float) -> float:
        nonlocal before
        speed, before = (position - before) / bench.period_s, position
        return stiffness * (size * (k // 500 % 3) - position) - damping * speed

    made = run_loop(sticky, control, 3.0)
    recording = recording_from_arrays(**made.signals)
    wrong, statistic = clipped(as_recorded(recording))
    assert not wrong.any() and statistic < thresholds.CLIPPED


@pytest.mark.parametrize("excitation", ["noise", "multisine"])
def test_rounding_is_no_tone(excitation: str) -> None:
    """A recording without noise or encoder: what stands out of nothing is nothing."""
    bench = Bench.from_device("lhifam").quiet()
    multisine = Multisine(4.0, 1.0, 200.0, 1.0, 8)
    force = WhiteNoise(4.0, 200.0, 0.7, 10.0) if excitation == "noise" else multisine
    made = simulate(bench, force, seed=1)
    recording = recording_from_arrays(**made.signals)
    etfe = estimate_etfe(recording)
    model = build_model("free", "lhifam")
    fit = least_squares(model, etfe, start=model.values)
    assert find_tones(recording, etfe.band_hz, fit.response).tones == ()


@pytest.mark.parametrize("seed", range(4))
def test_sweeps_that_nearly_repeat_are_no_tones(seed: int) -> None:
    """Where the force has tones itself, a response that is not quite the device's leaves some."""
    held = Device({**LHIFAM_HELD, "ground": [(0.1, 0.0), (4.0, 0.0), (18.0, 1500.0)]})
    rigid = Device({"masses": [5.4], "ground": [(22.0, 800.0)], "links": []})
    rng = np.random.default_rng(seed)
    samples, period_s, count = int(rng.uniform(6000, 12000)), 1e-3, 3e-7
    length, time_s = samples / rng.integers(4, 9), np.arange(samples) * period_s
    force = chirp(time_s % (length * period_s), 0.5, length * period_s, 300.0)
    position = held.simulate(force)
    between_hz = (np.round(50.0 * length * period_s) + 0.5) / (length * period_s)
    hum = 3e-6 * np.cos(2 * np.pi * between_hz * time_s)
    for added, tones in ((0.0, 0), (hum, 1)):
        rounded = np.round((position + added) / count) * count
        recording = recording_from_arrays(
            force=force, position=rounded, period_s=period_s, force_unit="N", position_unit="m"
        )
        band = estimate_etfe(recording).band_hz
        assert len(find_tones(recording, band, rigid.response).tones) == tones


@pytest.mark.parametrize("hum", [False, True])
def test_bursts_at_equal_times_through_an_uneven_actuator_are_no_tones(hum: bool) -> None:
    """What is weaker one way adds the size of the force, which has tones of its own."""
    rng, held, period_s = np.random.default_rng(9), Device(LHIFAM_HELD), 1e-3
    time_s = np.arange(12000) * period_s
    force = rng.normal(size=len(time_s)) * (np.arange(len(time_s)) % 500 < 200)
    position = held.simulate(force - 0.2 * np.abs(force))
    position += hum * 3e-6 * np.cos(2 * np.pi * 50.13 * time_s)
    recording = recording_from_arrays(
        force=force,
        position=3e-7 * np.round(position / 3e-7),
        period_s=period_s,
        force_unit="N",
        position_unit="m",
    )
    found = find_tones(recording, (0.7, 200.0), estimate_etfe(recording).spectra.reference)
    assert len(found.tones) == hum


@pytest.mark.parametrize("count, force", [(1e-4, True), (1e-4, False), (0.0, True)])
def test_a_regression_is_that_of_least_squares_whichever_way_it_is_solved(
    count: float, force: bool
) -> None:
    """Behind counts, without a force, and of a motion that its lags foretell to the last digit."""
    rng = np.random.default_rng(0)
    push = rng.standard_normal(4000) * force
    motion = lfilter(*butter(2, 0.04), rng.standard_normal(4000))
    motion = count * np.round(motion / count) if count else np.sin(0.05 * np.arange(4000.0))
    rows, lags = np.arange(20, 4000), np.arange(1, 21)
    design = np.column_stack([motion[rows[:, None] - lags], push[rows[:, None] - lags]])
    ridge = np.r_[np.zeros(20), np.full(20, 1e-4 * np.linalg.norm(push))]
    found = _regression(design, motion[rows], ridge)
    stacked = np.concatenate([design, np.diag(ridge)]), np.r_[motion[rows], np.zeros(40)]
    best = np.linalg.lstsq(*stacked, rcond=1e-13)[0]
    # What they foretell is asked for: of lags that say the same the coefficients are anything.
    assert design @ found == pytest.approx(design @ best, abs=1e-6 * np.std(motion))
    assert np.isfinite(found).all()
