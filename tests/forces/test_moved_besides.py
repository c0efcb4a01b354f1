"""A device that nobody is said to hold, and that moves beside what its command does."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fake_analysis import fake_analysis
from scipy.signal import butter, sosfilt

from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals.moved import moved_besides
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from benchmarks.strangers.sensed import make


def share(bench: Bench, pushed: float, seed: int = 1) -> float:
    """Of a recording whose device something pushes, too, at 2 to 6 Hz: force over the command's."""
    force = simulate(bench, WhiteNoise(bench.force_rms, 200.0, 0.7, 10.0), seed=seed).force
    band = butter(2, [2.0, 6.0], "band", fs=1e3, output="sos")
    push = sosfilt(band, np.random.default_rng(seed).standard_normal(len(force)))
    push *= pushed * np.std(force) / np.std(push)
    made = simulate(bench, force + push, seed=seed)
    recording = recording_from_arrays(force, made.position, 1e-3)
    etfe = estimate_etfe(recording, (0.7, 200.0))
    assert bench.device is not None
    return moved_besides(least_squares(build_model("free", bench.device), etfe), recording)


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
def test_what_moves_a_device_beside_its_command_is_measured(device: str) -> None:
    bench = Bench.from_device(device)
    assert share(bench, 0.0) < 0.03
    assert share(bench, 1.0) > 0.25


def test_the_noise_of_an_accelerometer_is_no_motion() -> None:
    """Integrated twice it wanders off by 0.9 of the command's speed; a shaken floor is seen."""
    case = make(94)
    recording = case.recording
    assert "acceleration" in case.what and isinstance(recording, Recording)
    begun = begin(recording, "free", Options(**case.told))
    sensed, period_s = recording.sensed, recording.period_s
    seen = begun.etfe.unbroken
    assert sensed is not None and seen is not None
    assert moved_besides(begun.fit, seen) < 0.15
    rate, time = 2 * np.pi * 3.0, np.arange(seen.samples) * period_s
    speed = np.std(np.gradient(seen.position, period_s))
    shaken = seen.position + speed * np.sqrt(2) / rate * np.sin(rate * time)
    assert moved_besides(begun.fit, replace(seen, position=shaken)) > 0.25


def test_no_stiffness_follows_where_something_else_moves_the_device() -> None:
    """Friction beside a floor that shook looked like damping: 7.3 times the limit, in green."""
    analysis = fake_analysis("free", "lhifam")
    assert headline(analysis).stiffness is not None
    own = analysis.recording
    time = np.arange(own.samples) * own.period_s
    shaken = own.position + 0.5 * np.std(own.position) * np.sin(2 * np.pi * 4 * time)
    analysis.etfe = replace(analysis.etfe, recording=replace(own, position=shaken))
    found = headline(analysis)
    assert found.stiffness is None and "looks like damping" in found.sentence
    # Only where nobody said that nobody does is a hand hinted at.
    candidates = {"grasped": SimpleNamespace(held=True), "free": SimpleNamespace(held=False)}
    analysis.choice = SimpleNamespace(candidates=candidates)
    assert "a hand (--held yes) or the floor" in headline(analysis).sentence
    del candidates["grasped"]
    said = headline(analysis).sentence
    assert "moves it, the floor, or" in said and "hand" not in said
    held = fake_analysis("grasped", "lhifam")
    held.etfe = replace(held.etfe, recording=replace(held.recording, position=shaken))
    assert headline(held).stiffness is not None
