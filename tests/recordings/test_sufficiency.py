"""Recordings that say too little are refused with the reason, the others are not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.errors import InputError
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.checks.sufficiency import LEAST_COHERENCE, refuse_where_told, too_little
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.read import read_recording
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.rig import Bench, Multisine, WhiteNoise, simulate

RECORDINGS = Path(__file__).parents[2] / "data" / "recordings"
BENCH = Bench.from_device("phantom")


def recorded(excitation: object, bench: Bench = BENCH) -> Recording:
    made = simulate(bench, excitation, seed=1)
    return recording_from_arrays(**made.signals)


def refuse(recording: Recording) -> None:
    refuse_where_told(recording, too_little(recording))


def noise(seconds: float = 8.0, rms: float = 0.1) -> np.ndarray:
    return simulate(BENCH, WhiteNoise(rms, 200.0, 0.7, seconds), seed=2).force


def idle() -> np.ndarray:
    force = noise()
    force[1000:5000] = 0
    return force


def pulses() -> np.ndarray:
    """Rests of 0.3 s between stretches of 0.2 s: none of them is long enough to be read."""
    return noise() * (np.arange(8000) % 500 < 200)


def blows() -> np.ndarray:
    """Eleven half waves of 5 ms, either way, as a sensor with noise of 0.3 % measures them."""
    force = np.zeros(8000)
    for number, first in enumerate(range(300, 7500, 650)):
        force[first : first + 5] = (-1) ** number * np.sin(np.pi * (np.arange(5) + 0.5) / 5)
    return force + np.random.default_rng(7).normal(0, 3e-3, 8000)


def backwards() -> Recording:
    made = recorded(noise())
    return replace(made, position=made.position[::-1])


def cut_off() -> Recording:
    made = recorded(noise(rms=0.3))
    middle = np.median(made.position)
    reach = 0.2 * np.std(made.position)
    return replace(made, position=np.clip(made.position, middle - reach, middle + reach))


TIME = np.arange(8000) * 1e-3
SAYS_TOO_LITTLE = {
    "2 s, and at least 2.5 s": lambda: recorded(noise(2.0)),
    "the force changes 3 times in 8 s": lambda: recorded(np.repeat([0.0, 0.1, -0.1, 0.0], 2000)),
    r"the force is a single tone \(3 Hz\)": lambda: recorded(0.1 * np.sin(6 * np.pi * TIME)),
    r"the force is 2 tones \(3, 11 Hz\)": lambda: recorded(
        0.1 * np.sin(6 * np.pi * TIME) + 0.05 * np.sin(22 * np.pi * TIME)
    ),
    "zero for 50 % .*, --rows 5001:8000": lambda: recorded(idle()),
    "zero for 60 % .* passes for damping; excite the device all the time": lambda: recorded(
        pulses()
    ),
    "next to zero for 9. % .* passes for damping": lambda: recorded(blows()),
    "stands still for": lambda: recorded(
        noise(rms=0.03), BENCH.with_effect("coulomb_friction", force=0.07)
    ),
    "stands still for [34]": lambda: recorded(  # at rest for some 50 ms of each 80
        np.repeat(np.random.default_rng(3).normal(0, 0.1, 100), 80),
        BENCH.with_effect("coulomb_friction", force=0.09),
    ),
    "stays at .* cut off": lambda: cut_off(),
    "hardly answers": lambda: backwards(),
}


@pytest.mark.parametrize("reason", SAYS_TOO_LITTLE)
def test_what_says_too_little_is_refused(reason: str) -> None:
    with pytest.raises(InputError, match=reason) as caught:
        refuse(SAYS_TOO_LITTLE[reason]())
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("period_s", "least"), [(4e-3, 2.5), (1e-3, 2.5), (1e-4, 0.791)])
def test_a_quicker_loop_needs_less_time(period_s: float, least: float) -> None:
    count = round(0.9 * least / period_s)
    rng = np.random.default_rng(4)
    force = rng.normal(size=2 * count)
    position = np.cumsum(np.cumsum(force)) * period_s**2
    whole = recording_from_arrays(force, position, period_s)
    assert not any("are needed of a force" in notice.text for notice in too_little(whole))
    told = too_little(replace(whole, force=force[:count], position=position[:count]))
    assert [f"at least {least:.3g} s" in notice.text for notice in told] == [True]


def test_noise_far_above_what_moves_the_device_is_no_silence() -> None:
    """White noise of a loop at 5 kHz: the encoder shows the motion in a tenth of the lines."""
    rng, period = np.random.default_rng(5), 2e-4
    force = rng.normal(0, 0.002, 60000)
    velocity = lfilter([0, period / 1e-4], [1, -(1 - 2 * period)], force)
    count = 2 * np.pi / 90000
    position = count * np.round(np.cumsum(velocity) * period / count)
    signals = {"period_s": period, "force_unit": "Nm", "position_unit": "rad"}
    recording = recording_from_arrays(force=force, position=position, **signals)
    rough = rough_response(recording)
    assert np.quantile(rough.coherence, 0.9) < LEAST_COHERENCE < 0.9 < rough.follows
    refuse(recording)
    with pytest.raises(InputError, match="hardly answers"):
        refuse(replace(recording, force=force[::-1]))


def levels(force: np.ndarray) -> bool:
    """Whether a recording of that force is said to hide what its actuator keeps back."""
    return any(notice.topic == "two levels" for notice in check_recording(recorded(force)))


def test_a_force_of_two_levels_hides_what_the_actuator_keeps_back() -> None:
    """A dead zone of a quarter of binary noise put the limit a third too high, said to be safe."""
    binary = 0.1 * np.sign(noise())
    paused = np.where(np.arange(len(binary)) < 500, 0.0, binary)
    for force in (binary, binary + 0.02, paused):
        assert levels(force)
    two_strengths = np.where(np.arange(len(binary)) % 2000 < 1000, binary, 0.5 * binary)
    struck = np.where(np.arange(len(binary)) % 500 < 5, np.abs(noise()), 0.0)
    for force in (noise(), two_strengths, binary + 0.1 * noise(), struck):
        assert not levels(force)


def test_no_test_reads_rounding_where_a_force_has_two_levels() -> None:
    """Its cube is itself: rounding was taken for a test, and an effect for unlikely."""
    etfe = estimate_etfe(recorded(0.1 * np.sign(noise())), (0.7, 200.0))
    assert BENCH.device is not None
    fit = least_squares(build_model("free", BENCH.device), etfe)
    cubed = {test.name: test for test in nonlinear_tests(fit, etfe)}["u^3"]
    assert cubed.statistic == 0.0
    assert cubed.force is not None and cubed.force.sd == 0.0


def test_what_says_enough_is_not_refused() -> None:
    multisine = Multisine(0.1, 1.0, 100.0, 1.0, 2)
    for excitation in (noise(3.0), multisine, np.sign(noise())):
        refuse(recorded(excitation))
    for path in RECORDINGS.glob("*.csv.gz"):
        if "relay" not in path.name:
            refuse(read_recording(path))
