"""Relay experiments: what is measured, what it is compared with, and what is warned of."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from bayeshaptic import cli
from bayeshaptic.errors import InputError
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.rig import Bench, SimulatedRecording, run_relay
from bayeshaptic.stability import check_relay, measure_relay

DEVICES = [("lhifam", "grasped"), ("phantom", "grasped"), ("lhifam", "free"), ("phantom", "free")]


def logged(run: SimulatedRecording) -> Recording:
    return recording_from_arrays(**run.signals)


@cache
def relay(device: str, mechanism: str, seed: int = 0) -> Recording:
    return logged(run_relay(Bench.from_device(device, mechanism == "grasped"), seed=seed))


def sine(hz: float, seconds: float = 20.0) -> tuple[np.ndarray, np.ndarray]:
    """A square wave of whole samples, and a sine of 1 mm against it."""
    time = np.arange(round(seconds * 1e3)) * 1e-3
    motion = np.sin(2 * np.pi * hz * (time + 0.5e-3))
    return -np.sign(motion), 1e-3 * motion


@pytest.mark.parametrize(("device", "mechanism"), DEVICES)
def test_the_gain_is_the_response_at_the_oscillation(device, mechanism):
    measured = measure_relay(relay(device, mechanism))
    check = check_relay(measured, build_model(mechanism, device))
    # Where the oscillation is locked, the phantom's phase of 1 degree is spread over 2 lines.
    assert abs(check.difference_db) < 3 * measured.gain_margin_sd_db + 0.06
    assert abs(measured.phase_deg) <= measured.phase_bound_deg
    assert measured.share > 0.95
    assert not [n for n in measured.notices if n.level == "warning"]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("device", ["lhifam", "phantom"])
def test_held_devices_the_critical_stiffness_is_that_of_the_bench(device, seed):
    measured = measure_relay(relay(device, "grasped", seed))
    truth = 20 * np.log10(Bench.from_device(device, held=True).true_critical_stiffness())
    assert measured.critical_sd_db < 0.3
    assert abs(measured.critical_db - truth) < 3 * measured.critical_sd_db
    # Uncorrected, the relay is far outside its own error.
    assert measured.gain_margin_db < truth - 10 * measured.gain_margin_sd_db


def test_free_devices_settle_beside_the_crossing_and_it_is_said_which():
    lhifam, phantom = (measure_relay(relay(device, "free")) for device in ("lhifam", "phantom"))
    assert lhifam.critical_stiffness is None
    assert [n.topic for n in lhifam.notices] == ["no crossing"]
    check = check_relay(lhifam, build_model("free", "lhifam"))
    assert check.settled_on == "vibration mode at 102 Hz" and not check.binds
    assert 20 * np.log10(check.critical_estimate) == pytest.approx(87.57, abs=0.1)
    check = check_relay(phantom, build_model("free", "phantom"))
    assert check.settled_on.startswith("rigid body") and check.binds
    assert 20 * np.log10(check.critical_estimate) == pytest.approx(22.42, abs=0.1)


def test_hysteresis_lowers_the_frequency():
    bench = Bench.from_device("phantom", held=True)
    plain = measure_relay(relay("phantom", "grasped"))
    late = measure_relay(logged(run_relay(bench, hysteresis=2e-3)))
    assert late.frequency_hz < plain.frequency_hz - 3
    assert late.phase_deg > plain.phase_deg + 5


def test_a_sine_is_read_to_the_digit():
    force, position = sine(40.0)
    measured = measure_relay(recording_from_arrays(force, position, 1e-3))
    # 25 samples a period: the square wave's first harmonic, from the samples themselves.
    samples = np.arange(25)
    wave = np.exp(-2j * np.pi * samples / 25)
    ratio = abs(wave @ force[:25] / (wave @ position[:25]))
    assert measured.frequency_hz == pytest.approx(40.0, abs=0.02)
    assert measured.gain_margin == pytest.approx(ratio, rel=2e-3)
    assert measured.unit == "N/m"


def topics(force: np.ndarray, position: np.ndarray) -> list[str]:
    return [n.topic for n in measure_relay(recording_from_arrays(force, position, 1e-3)).notices]


def test_warnings():
    force, position = sine(40.0)
    time = np.arange(len(force)) * 1e-3
    clean = topics(force, position)
    assert "not steady" in topics(force, position * (1 + 0.6 * np.sin(2 * np.pi * 0.15 * time)))
    assert "not sinusoidal" in topics(force, position + 1e-3 * np.sin(2 * np.pi * 90 * time))
    assert "short" in topics(force[:8000], position[:8000])
    assert "no relay" in topics(force * (1 + 0.3 * np.sin(70 * time)), position)
    assert "phase" in topics(force, np.roll(position, 6))
    assert not {"not steady", "not sinusoidal", "short", "no relay", "phase"} & set(clean[1:])


def test_a_transient_is_left_out():
    force, position = sine(40.0, 30.0)
    early = np.arange(len(force)) < 6000
    measured = measure_relay(recording_from_arrays(force, np.where(early, 5, 1) * position, 1e-3))
    assert 6.0 <= measured.steady_s[0] <= 9.0
    whole = measure_relay(recording_from_arrays(force, position, 1e-3))
    assert measured.gain_margin == pytest.approx(whole.gain_margin, rel=1e-4)


def test_of_several_set_points_the_stretch_with_the_most_switches_is_read():
    force, position = sine(40.0, 30.0)
    whole = measure_relay(recording_from_arrays(force, position, 1e-3))
    assert whole.set_point == pytest.approx(0.0, abs=1e-4)
    set_point = np.interp(np.arange(len(force)), [7990, 8010], [-0.01, 0.02])
    measured = measure_relay(recording_from_arrays(force, position + set_point, 1e-3))
    assert measured.set_point == pytest.approx(0.02, abs=2e-4)
    assert measured.steady_s[0] >= 7.9 and measured.steady_s[1] == pytest.approx(30, abs=0.1)
    assert measured.gain_margin == pytest.approx(whole.gain_margin, rel=2e-3)
    assert measured.frequency_hz == pytest.approx(whole.frequency_hz, abs=0.02)
    assert "set point" in [notice.topic for notice in measured.notices]


def test_what_cannot_be_measured():
    force, position = sine(40.0)
    with pytest.raises(InputError, match="force never changes"):
        measure_relay(recording_from_arrays(0 * force, position, 1e-3))
    with pytest.raises(InputError, match="samples are too few"):
        measure_relay(recording_from_arrays(force[:100], position[:100], 1e-3))
    measured = measure_relay(relay("phantom", "grasped"))
    with pytest.raises(InputError, match="N m/rad"):
        check_relay(measured, build_model("free", "lhifam"))
    with pytest.raises(InputError, match="no sampling period"):
        check_relay(measured, replace(build_model("free", "phantom"), period_s=None))


def test_commands(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "relay.csv"
    made = ["simulate", "lhifam", "--excitation", "relay", "--seconds", "20", "-o", str(path)]
    assert cli.main([*made, "--quiet"]) == 0
    assert cli.main(["relay", str(path), "--device", "lhifam", "--model", "free"]) == 0
    out = capfd.readouterr().out
    assert "oscillates at 101.6" in out and "settled on another crossing: vibration mode" in out
    assert cli.main(["simulate", "lhifam", "--hysteresis", "1e-4", "-o", f"{path}2.csv"]) == 2
    assert "--excitation relay" in capfd.readouterr().err


def test_what_is_no_relay_recording_is_refused() -> None:
    rng = np.random.default_rng(0)
    position = np.cumsum(rng.normal(size=20_000))
    noise = Recording(rng.normal(size=20_000), position, 1e-3)
    with pytest.raises(InputError, match="% of the force is at the levels"):
        measure_relay(noise)
    switching = Recording(np.sign(noise.force), position - position.mean(), 1e-3)
    with pytest.raises(InputError, match="does not switch with the position"):
        measure_relay(switching)
