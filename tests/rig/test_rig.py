"""The virtual bench: its linear response, noise, encoder, files, loops and stability limit."""

from __future__ import annotations

import ast
import gzip
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.signal
from rig_reference import continuous, sampled, stepped

import bayeshaptic.rig
from bayeshaptic.errors import InputError
from bayeshaptic.rig import (
    Bench,
    Multisine,
    WhiteNoise,
    critical_limit,
    run_loop,
    run_relay,
    run_wall,
    simulate,
    spectral_radius,
    write_recording,
)
from bayeshaptic.rig.noise import shaped_noise, tremor_density

CASES = [(d, m) for d in ("lhifam", "phantom") for m in ("rigid", "free", "grasped")]
PERIOD = 1e-3


def still(device: str, mechanism: str, **changes: object) -> Bench:
    return Bench.from_device(device, mechanism=mechanism, **changes).quiet()


@pytest.mark.parametrize("periods", [0.0, 0.3, 1.0, 2.3])
@pytest.mark.parametrize(("device", "mechanism"), CASES)
def test_response_is_that_of_matrix_exponentials(
    device: str, mechanism: str, periods: float
) -> None:
    if mechanism == "rigid" and device == "phantom":
        bench = still("lhifam", "rigid", period_s=4e-4, delay_s=periods * 4e-4)
    else:
        bench = still(device, mechanism, delay_s=periods * PERIOD)
    force = np.random.default_rng(3).normal(size=300)
    got = simulate(bench, force).position
    expected = stepped(dict(bench.values), force, bench.period_s, bench.delay_s)
    assert np.max(np.abs(got - expected)) < 1e-9 * np.max(np.abs(expected))


@pytest.mark.parametrize("periods", [0.0, 0.2, 1.0, 2.3])
@pytest.mark.parametrize(("device", "mechanism"), CASES)
def test_steady_state_is_the_frequency_response(
    device: str, mechanism: str, periods: float
) -> None:
    bench = still(device, mechanism, delay_s=periods * PERIOD)
    excitation = Multisine(bench.force_rms, 2.0, 480.0, spacing_hz=2.0, periods=2, phase="random")
    recording = simulate(bench, excitation, seed=1, settle_s=30.0)
    lines = excitation.lines_hz(PERIOD)
    at = np.round(lines * 2 * len(recording.force) * PERIOD / 2).astype(int)
    got = np.fft.rfft(recording.position)[at] / np.fft.rfft(recording.force)[at]
    expected = sampled(continuous(dict(bench.values)), lines, PERIOD, bench.delay_s)
    # A free device still drifts by exp(-30 s b/m), and what is left of it leaks onto the lines.
    assert np.max(np.abs(got / expected - 1)) < 1e-6


def test_time_steps_without_nonlinear_force_are_the_closed_form() -> None:
    bench = still("lhifam", "grasped", delay_s=1.7e-3)
    force = np.random.default_rng(0).normal(size=500)
    plain = simulate(bench, force).position
    weak = simulate(bench.with_effect("hardening_spring", stiffness=0.0), force).position
    assert np.max(np.abs(plain - weak)) < 1e-11 * np.max(np.abs(plain))


def test_hand_force_acts_as_a_straight_line_between_samples() -> None:
    bench = replace(Bench.from_device("phantom", held=True), encoder_resolution=0.0)
    recording = simulate(bench, np.zeros(3000), seed=4)
    plant = bench.plant()
    system = (plant.dynamics, plant.hand[:, None], plant.position[None], [[0.0]])
    _, expected, _ = scipy.signal.lsim(system, recording.hand_force, recording.time_s)
    assert np.max(np.abs(recording.position - expected)) < 1e-9 * np.max(np.abs(expected))


def test_a_recording_may_begin_in_the_steady_state_and_in_motion() -> None:
    bench = still("lhifam", "grasped")
    excitation = Multisine(1.0, 5.0, 100.0, spacing_hz=1.0, periods=2)
    first, second = simulate(bench, excitation, settle_s=20.0).position.reshape(2, -1)
    assert np.max(np.abs(first - second)) < 1e-6 * np.max(np.abs(first))
    rolling = simulate(still("lhifam", "rigid"), np.zeros(1000), start={"m1": (0.1, 0.5)}).position
    rate = 6.9 / 5.39
    expected = 0.1 + 0.5 / rate * (1 - np.exp(-rate * np.arange(1000) * PERIOD))
    np.testing.assert_allclose(rolling, expected, rtol=1e-11)


def test_white_noise_has_its_band_and_level() -> None:
    recording = simulate(still("lhifam", "free"), WhiteNoise(3.0, 250.0, 20.0, 20.0), seed=2)
    assert np.sqrt(np.mean(recording.force**2)) == pytest.approx(3.0, rel=1e-12)
    frequency, density = scipy.signal.welch(
        recording.force, 1 / PERIOD, nperseg=1000, detrend=False
    )
    inside = density[(frequency > 25) & (frequency < 245)]
    # 40 segments, half overlapping: a line's density has a relative sd of about 0.18.
    assert np.mean(inside) == pytest.approx(9.0 / 230.0, rel=0.05)
    assert np.all(np.abs(inside / np.mean(inside) - 1) < 0.9)
    assert np.max(density[(frequency < 15) | (frequency > 255)]) < 1e-3 * np.mean(inside)


def test_multisine_excites_its_lines_alone() -> None:
    bench = still("lhifam", "free", period_s=4e-4)
    for phase in ("schroeder", "random"):
        excitation = Multisine(2.0, 11.0, 250.0, spacing_hz=0.5, periods=3, phase=phase)
        force = simulate(bench, excitation, seed=1).force
        assert len(force) == 3 * excitation.period_samples(4e-4) == 15000
        power = np.abs(np.fft.rfft(force[:5000])) ** 2
        lines = np.zeros(len(power), dtype=bool)
        lines[22:501] = True
        assert np.ptp(power[lines]) < 1e-6 * power[lines].max()
        assert power[~lines].max() < 1e-20 * power[lines].max()
        assert np.sqrt(np.mean(force**2)) == pytest.approx(2.0)
    crest = np.max(np.abs(Multisine(1.0, 11.0, 250.0).force(0, 4e-4, np.random.default_rng(0))))
    assert crest < 2.0


def test_tremor_is_a_band_and_wander_is_slow() -> None:
    bench = Bench.from_device("phantom", held=True)
    tremor = simulate(replace(bench, wander_rms=0.0), np.zeros(60000), seed=5).hand_force
    wander = simulate(replace(bench, tremor_rms=0.0), np.zeros(60000), seed=5).hand_force
    frequency, density = scipy.signal.welch(tremor, 1 / PERIOD, nperseg=8000)
    share = density[(frequency >= 8) & (frequency <= 12)].sum() / density.sum()
    assert 0.6 < share < 0.9
    assert 8 < frequency[np.argmax(density)] < 12
    # The band holds some 4 Hz x 60 s independent pairs: the rms is good to about 4 %.
    assert np.std(tremor) == pytest.approx(bench.tremor_rms, rel=0.15)
    frequency, density = scipy.signal.welch(wander, 1 / PERIOD, nperseg=20000)
    assert density[frequency > 1].sum() < 1e-3 * density.sum()
    both = simulate(bench, np.zeros(60000), seed=5).hand_force
    np.testing.assert_allclose(both, tremor + wander, atol=1e-15)


def test_nobody_trembles_where_nobody_holds() -> None:
    free = Bench.from_device("lhifam")
    assert not simulate(free, np.zeros(100)).position.any()
    assert simulate(Bench.from_device("lhifam", held=True), np.zeros(100)).position.any()


def test_shaped_noise_has_unit_variance_and_no_period() -> None:
    rng = np.random.default_rng(0)
    runs = np.array([shaped_noise(tremor_density((8, 12)), 2000, PERIOD, rng) for _ in range(300)])
    assert np.mean(runs**2) == pytest.approx(1.0, rel=0.05)
    ends = np.mean(runs[:, 0] * runs[:, -1])
    assert abs(ends) < 3.5 / np.sqrt(300)


def test_positions_are_whole_counts() -> None:
    bench = Bench.from_device("lhifam", held=True)
    recording = simulate(bench, seed=1)
    counts = recording.position / 3.14e-6
    assert np.max(np.abs(counts - np.round(counts))) < 1e-6
    error = recording.position - recording.true_position
    assert np.max(np.abs(error)) <= 0.5 * 3.14e-6 * (1 + 1e-9)
    assert np.std(error) == pytest.approx(3.14e-6 / np.sqrt(12), rel=0.02)
    noisy = simulate(replace(bench, encoder_resolution=0.0, sensor_noise_rms=1e-5), seed=1)
    assert np.std(noisy.position - noisy.true_position) == pytest.approx(1e-5, rel=0.02)


def test_a_seed_gives_one_recording_and_its_parts_stay_when_an_effect_is_added() -> None:
    bench = Bench.from_device("lhifam", held=True)
    first, again, other = (simulate(bench, seed=seed) for seed in (7, 7, 8))
    np.testing.assert_array_equal(first.position, again.position)
    assert np.std(first.force - other.force) > 1.0
    lagging = simulate(bench.with_effect("actuator_lag").with_effect("held_samples"), seed=7)
    np.testing.assert_array_equal(first.force, lagging.force)
    np.testing.assert_array_equal(first.hand_force, lagging.hand_force)
    assert np.any(first.position != lagging.position)


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".npz", ".h5", ".hdf5", ".mat"])
@pytest.mark.parametrize(("device", "force"), [("lhifam", "force_n"), ("phantom", "torque_nm")])
def test_files_hold_the_recording(tmp_path: Path, suffix: str, device: str, force: str) -> None:
    bench = Bench.from_device(device, held=True)
    recording = simulate(bench, WhiteNoise(bench.force_rms, 200.0, seconds=1.0))
    path = write_recording(tmp_path / f"x{suffix}", recording)
    names = list(recording.columns)
    assert names[:2] == ["time_s", force]
    if ".csv" in suffix:
        raw = path.read_bytes()
        lines = (gzip.decompress(raw) if suffix.endswith("gz") else raw).decode().splitlines()
        assert lines[0] == ",".join(names)
        read = dict(zip(names, np.loadtxt(lines[1:], delimiter=",").T, strict=True))
    elif suffix == ".npz":
        read = dict(np.load(path))
    elif suffix == ".mat":
        read = {name: scipy.io.loadmat(path)[name].ravel() for name in names}
    else:
        with h5py.File(path) as file:
            read = {name: file[name][:] for name in names}
    for name in names:
        scale = np.max(np.abs(recording.columns[name]))
        assert np.max(np.abs(read[name] - recording.columns[name])) < 1e-6 * scale
    counts = read[names[2]] / bench.encoder_resolution
    assert np.max(np.abs(counts - np.round(counts))) < 0.01
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_what_cannot_be_is_refused_in_one_line(tmp_path: Path) -> None:
    bench = Bench.from_device("lhifam")
    recording = simulate(bench, np.ones(10))
    refusals = {
        "cannot write this kind": lambda: write_recording(tmp_path / "x.xlsx", recording),
        "cannot be written": lambda: write_recording(tmp_path / "no" / "x.csv", recording),
        "missing: b, unknown: c": lambda: Bench("rigid", {"m": 1.0, "c": 2.0}),
        "mass m is 0": lambda: Bench("rigid", {"m": 0.0, "b": 2.0}),
        "unknown mechanism": lambda: Bench("soft", {}),
        "period": lambda: Bench("rigid", {"m": 1.0, "b": 2.0}, period_s=0.0),
        "unknown effect 'rust'": lambda: bench.with_effect("rust"),
        "has no amount": lambda: bench.with_effect("extra_delay", amount=1.0),
        "force is -1; give a number of at least zero": lambda: bench.with_effect(
            "coulomb_friction", force=-1.0
        ),
        "frequency_hz is 0; give a number above zero": lambda: bench.with_effect(
            "second_mode", frequency_hz=0.0
        ),
        "order is 1.5; give a whole number": lambda: bench.with_effect("actuator_lag", order=1.5),
        "that is finite": lambda: bench.with_effect("centring_stiffness", stiffness=np.nan),
        "no mass 'm3'": lambda: bench.with_effect("coulomb_friction", on="m3"),
        "needs a hand": lambda: bench.with_effect("reflex"),
        "whole number": lambda: simulate(bench, Multisine(1.0, 1.0, 10.0, spacing_hz=0.3)),
        "Nyquist": lambda: simulate(bench, Multisine(1.0, 1.0, 500.0)),
        "no band": lambda: simulate(bench, WhiteNoise(1.0, 10.0, 20.0)),
        "no lines in 30 s below the Nyquist": lambda: simulate(bench, WhiteNoise(1.0, 900, 600)),
        "no lines in 2 s": lambda: simulate(bench, WhiteNoise(1.0, 0.2, 0.1, seconds=2.0)),
        "100,000,000,000 samples, and 20,000,000 are the": lambda: simulate(
            bench, WhiteNoise(1.0, 300.0, seconds=1e8)
        ),
        "1,000,000,000 samples": lambda: simulate(bench, Multisine(1.0, 1, 9, periods=1_000_000)),
        "100,000,001,000 samples": lambda: run_relay(bench, 1.0, seconds=1e8 + 1),
        "delay of 200 s is over 100 sampling": lambda: simulate(replace(bench, delay_s=200.0)),
        "finite": lambda: simulate(bench, [1.0, np.nan]),
        "amplitude above zero": lambda: run_relay(bench, -1.0),
    }
    for text, attempt in refusals.items():
        with pytest.raises(InputError, match=text) as caught:
            attempt()
        assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


DEVICES = [(d, held) for d in ("lhifam", "phantom") for held in (True, False)]


@pytest.mark.parametrize(
    ("device", "held", "decibel", "frequency_hz"),
    [
        ("phantom", True, 40.92, 63.46),
        ("phantom", False, 22.42, 17.67),
        ("lhifam", True, 86.95, 102.84),
        ("lhifam", False, 86.90, 8.69),
    ],
)
def test_critical_stiffness_of_the_published_devices(
    device: str, held: bool, decibel: float, frequency_hz: float
) -> None:
    limit = critical_limit(Bench.from_device(device, held=held))
    assert 20 * np.log10(limit.stiffness) == pytest.approx(decibel, abs=0.01)
    assert limit.frequency_hz == pytest.approx(frequency_hz, abs=0.01)


@pytest.mark.parametrize(("device", "held"), DEVICES)
def test_walls_are_stable_below_and_unstable_above_the_limit(device: str, held: bool) -> None:
    bench = Bench.from_device(device, held=held).quiet()
    limit = bench.true_critical_stiffness()
    for factor in (0.99, 1.01):
        run = run_wall(bench, factor * limit, seconds=20.0)
        expected = np.log(spectral_radius(bench, factor * limit)) / bench.period_s
        assert run.stable == (factor < 1)
        assert run.growth_per_s == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("device", "effect", "changes"),
    [
        ("lhifam", "actuator_lag", {"order": 2}),
        ("lhifam", "extra_delay", {"delay_s": 2.1e-3}),
        ("phantom", "base_compliance", {}),
        ("phantom", "position_filter", {"order": 2}),
        ("phantom", "structural_damping", {}),
        ("lhifam", "reflex", {"damping": 70.0, "stiffness": 500.0}),
    ],
)
def test_the_limit_with_effects_is_where_walls_turn_unstable(
    device: str, effect: str, changes: dict[str, float]
) -> None:
    bench = Bench.from_device(device, held=True).quiet()
    changed = bench.with_effect(effect, **changes)
    limit = changed.true_critical_stiffness()
    assert abs(np.log(limit / bench.true_critical_stiffness())) > 0.02
    rates = [run_wall(changed, f * limit, seconds=8.0).growth_per_s for f in (0.99, 1.01)]
    assert rates[0] < 0 < rates[1]


def test_damping_in_the_wall_and_limits_at_zero_and_nyquist() -> None:
    bench = Bench.from_device("phantom").quiet()
    limit = bench.true_critical_stiffness(damping=5e-3)
    assert limit > 1.2 * bench.true_critical_stiffness()
    for factor in (0.99, 1.01):
        run = run_wall(bench, factor * limit, damping=5e-3)
        assert run.stable == (factor < 1)
    frictionless = Bench("rigid", {"m": 1.0, "b": 0.0}, delay_s=2e-4)
    assert frictionless.true_critical_stiffness() == 0.0
    # A heavily damped mass is an integrator with a lag m/b, and its response at Nyquist is
    # -(T - 2 m/b tanh(T b/(2 m)))/(2 b).
    for mass, damper in ((1e-3, 20.0), (1e-3, 1e3), (1e-6, 1e3), (1.0, 1e4)):
        syrup = critical_limit(Bench("rigid", {"m": mass, "b": damper}))
        assert syrup.frequency_hz == pytest.approx(500.0)
        lag = mass / damper * np.tanh(PERIOD * damper / (2 * mass))
        assert syrup.stiffness == pytest.approx(2 * damper / (PERIOD - 2 * lag), rel=1e-6)
    with pytest.raises(InputError, match="no edge of stability up to"):
        critical_limit(Bench("rigid", {"m": 1e-9, "b": 1e9}))


@pytest.mark.parametrize("device", ["phantom", "lhifam"])
def test_a_relay_oscillates_where_the_phase_allows(device: str) -> None:
    bench = Bench.from_device(device, held=device == "lhifam").quiet()
    recording = run_relay(bench, 0.3, seconds=12.0)
    assert set(np.unique(recording.force)) == {-0.3, 0.3}
    assert np.all(recording.force[1:][recording.position[1:] > 0] == -0.3)
    steady = recording.force[4000:] * np.hanning(8000)
    got = np.argmax(np.abs(np.fft.rfft(steady))) / 8.0
    frequency = np.linspace(5.0, 150.0, 20000)
    response = continuous(dict(bench.values))(2j * np.pi * frequency)
    # The force switches between 0 and T after the zero crossing, and acts delay_s later.
    edges = []
    for late in (PERIOD, 0.0):
        delayed = response * np.exp(-2j * np.pi * frequency * (bench.delay_s + late))
        turns = np.flatnonzero((np.diff(np.sign(delayed.imag)) > 0) & (delayed.real[:-1] < 0))
        edges.append(frequency[turns[np.argmin(delayed.real[turns])]])
    assert edges[0] - 0.2 < got < edges[1] + 0.2


def test_hysteresis_and_default_level_of_the_relay() -> None:
    bench = Bench.from_device("phantom")
    sharp, wide = (run_relay(bench, seconds=8.0, hysteresis=h) for h in (0.0, 0.02))
    assert np.max(sharp.force) == pytest.approx(3 * bench.force_rms)
    assert np.std(wide.position[4000:]) > 1.5 * np.std(sharp.position[4000:])
    up = (wide.force[1:] > 0) & (wide.force[:-1] < 0)
    assert np.all(wide.position[1:][up] < -0.02)


def test_any_controller_closes_the_loop_on_what_it_reads() -> None:
    bench = Bench.from_device("lhifam", held=True)
    target = 0.01 * np.sin(2 * np.pi * np.arange(3000) * PERIOD)
    recording = run_loop(bench, lambda k, x: 2000.0 * (target[k] - x), 3.0, seed=2)
    np.testing.assert_array_equal(recording.force, 2000.0 * (target - recording.position))
    open_loop = simulate(bench, recording.force, seed=2)
    np.testing.assert_allclose(open_loop.true_position, recording.true_position, atol=1e-12)


def test_the_bench_shares_nothing_with_the_models_it_checks() -> None:
    folder = Path(bayeshaptic.rig.__file__).parent
    allowed = tuple(
        f"bayeshaptic.{room}" for room in ("rig", "compiled", "errors", "devices", "files")
    )
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("bayeshaptic"):
                assert (node.module or "").startswith(allowed), f"{path.name}: {node.module}"
