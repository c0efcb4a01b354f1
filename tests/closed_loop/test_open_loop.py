"""Steps, pulses, tones in open loop: one mass is followed in time, and gets no stiffness."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from one_truth import check_page, numbers_of, page_of, words_only

from bayeshaptic.diagnosis.analyse import analyse
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import MotionFit, fit_motion
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES
from bayeshaptic.recordings import join_recordings, recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report import write_report
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, simulate
from bayeshaptic.types import Floats

MASS, DAMPING, FRICTION, DELAY_S = 2.0, 12.0, 1.5, 0.7e-3
_REACH = 4.5  # standard deviations: 1 in 500 with eight degrees of freedom


def bench(friction: float = FRICTION) -> Bench:
    made = Bench("rigid", {"m": MASS, "b": DAMPING}, delay_s=DELAY_S, encoder_resolution=2e-6)
    return made.with_effect("coulomb_friction", force=friction) if friction else made


def under(force: Floats, device: Bench, name: str = "steps") -> Recording:
    made = simulate(device, force, seed=1)
    return recording_from_arrays(made.force, made.position, period_s=1e-3, name=name)


def steps(seconds: float = 0.5) -> Floats:
    heights = [0.0, 5.0, -4.0, 6.0, -5.0, 4.0, -6.0, 5.0, -3.0, 3.0, -5.0, 2.0]
    return np.repeat(heights, int(seconds * 1000))


def pulse(height: float) -> Floats:
    """A rotor that friction holds, before and after."""
    time_s = np.arange(3000) * 1e-3
    return np.where((time_s >= 0.2) & (time_s < 1.5), height, 0.0)


def tone() -> Floats:
    return np.asarray(5.0 * np.sin(2 * np.pi * 3.0 * np.arange(6000) * 1e-3))


@pytest.fixture(scope="module")
def told() -> Closed:
    return close_loop(under(steps(), bench()), "rigid", ess=600)


def interval(closed: Closed, name: str) -> tuple[float, float]:
    posterior = closed.analysis.stated
    low, high = posterior.quantile(np.array([0.001, 0.999]))[:, posterior.names.index(name)]
    return float(low), float(high)


def test_steps_tell_the_parameters_of_one_mass(told: Closed) -> None:
    truth = {"m": MASS, "b": DAMPING, "coulomb": FRICTION, "offset": 0.0, "delay_s": DELAY_S}
    for name, value in truth.items():
        low, high = interval(told, name)
        assert low < value < high
    low, high = interval(told, "m")
    assert high < 1.01 * low


def test_and_no_stiffness(told: Closed) -> None:
    found = headline(told)
    assert (found.status, found.stiffness) == ("untrusted", None)
    assert "the force changes 11 times" in found.sentence
    assert any("It was recorded in open loop" in text for text in found.details)
    assert "Critical stiffness" not in repr(told)


def test_its_page_says_that_it_was_open_loop(
    told: Closed, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words_only(monkeypatch)
    write_report(told, tmp_path)
    check_page(told, tmp_path)
    page, found = page_of(tmp_path), numbers_of(tmp_path)
    assert "simulated under the same command" in page
    assert "Record some 30 s of white noise or of a multisine" in page
    for words in (
        "in closed loop",
        "computed from the motion, so",
        "in the same loop",
        "biases the",
    ):
        assert words not in page
    assert found["recording"]["feedback"] is False
    assert found["critical_stiffness"]["q50"] is None
    assert found["critical_stiffness"]["safe"]["0.01"] is None
    assert found["recommendation"]["stiffness"] is None
    assert all(one["trusted"] for one in found["posterior"]["parameters"].values())
    assert "too little" in {notice["topic"] for notice in found["notices"]}


def test_what_is_not_declared_to_be_one_mass_is_refused_as_ever() -> None:
    recording = under(steps(), bench())
    with pytest.raises(InputError, match="too little to find a stiffness from: the force changes"):
        close_loop(recording)
    with pytest.raises(InputError, match="too little to find a stiffness from: the force changes"):
        analyse(recording, "rigid")  # which follows nothing in time


def test_nor_is_what_does_not_move_as_one_mass_told() -> None:
    gives = bench(0.0).with_effect("base_compliance", frequency_hz=12.0, mass_ratio=2.0)
    with pytest.raises(InputError, match="too little to find a stiffness from"):
        close_loop(under(steps(), gives), "rigid", ess=600)


def test_a_tone_tells_mass_and_damping_as_far_as_they_are_one_mass() -> None:
    closed = close_loop(under(tone(), bench(0.0)), "rigid", ess=600)
    assert closed.analysis.in_loop is not None
    for name, value in (("m", MASS), ("b", DAMPING)):
        low, high = interval(closed, name)
        assert low < value < high
    # At its one frequency a base that gives, or a gain that ripples, is like another mass.
    low, high = interval(closed, "m")
    assert high > 1.01 * low
    assert any("a tone cannot tell" in notice.text for notice in closed.analysis.notices)
    assert headline(closed).stiffness is None


def fits() -> dict[str, MotionFit]:
    single = [under(pulse(height), bench(), f"{height}") for height in (1.8, 3.0)]
    return {one.name: fit_motion(one) for one in (*single, join_recordings(single))}


def test_single_steps_of_a_rotor_that_friction_holds_agree() -> None:
    for name, found in fits().items():
        apart = np.abs(found.values - [MASS, DAMPING, FRICTION, 0.0, DELAY_S])
        assert np.all(apart < _REACH * found.sd), name
        # Moving one way it says how large friction and constant force are together.
        both = [NAMES.index("coulomb"), NAMES.index("offset")]
        together = found.covariance[np.ix_(both, both)].sum()
        assert np.all(found.sd[both] > 0.1 * FRICTION), name
        assert np.sqrt(together) < 0.1 * FRICTION, name


def test_a_motion_that_goes_far_away_is_begun_with_near_its_mass() -> None:
    """The filter that the fit begins with took the end of a motion for a stop."""
    drifts = Bench("rigid", {"m": 7.0, "b": 0.15}, delay_s=DELAY_S, encoder_resolution=2e-6)
    rng = np.random.default_rng(0)
    heights = 5.0 * rng.uniform(0.3, 1.0, 12) * np.tile([1.0, -1.0], 6)
    force = np.append(np.zeros(50), np.repeat(heights, rng.uniform(100, 800, 12).astype(int)))
    found = fit_motion(under(force, drifts))
    assert found.converged
    assert abs(found.values[0] - 7.0) < _REACH * found.sd[0]
    assert found.sd[0] < 0.01 * 7.0
