"""Moments in which something else moved the device: found, and what pushed added to the command."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from on_the_bench import recorded_on

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.samples.mend import repair_measurement
from bayeshaptic.diagnosis.samples.outside import BLOCK, outside
from bayeshaptic.diagnosis.samples.prediction import as_recorded
from bayeshaptic.diagnosis.state import State
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.stability.critical import critical_stiffness

SECONDS, PERIOD_S = 12.0, 1e-3
BENCHES = {
    "phantom": Bench.from_device("phantom"),
    "lhifam, held": Bench.from_device("lhifam", held=True),
}
MOMENTS: dict[str, dict[str, float]] = {
    "bump": {"begin_s": 5.0, "length_s": 0.15},
    "lost_command": {"begin_s": 7.0, "length_s": 0.3},
}


@cache
def recorded(device: str, *effects: tuple[str, Any]) -> Recording:
    bench = BENCHES[device]
    for name, fields in effects:
        bench = bench.with_effect(name, **dict(fields))
    return recorded_on(bench, WhiteNoise(bench.force_rms, 200.0, 0.7, SECONDS), seed=11)


def with_moment(device: str, name: str) -> Recording:
    return recorded(device, (name, tuple(MOMENTS[name].items())))


def begun(recording: Recording, device: str) -> State:
    bench = BENCHES[device]
    etfe = estimate_etfe(recording, (0.7, 200.0))
    assert bench.device is not None
    return State(etfe, least_squares(build_model(bench.mechanism, bench.device), etfe))


@pytest.mark.parametrize("device", BENCHES)
@pytest.mark.parametrize("name", MOMENTS)
def test_a_moment_is_found_where_it_was_and_what_pushed_is_as_large(name: str, device: str) -> None:
    recording = with_moment(device, name)
    found = outside(as_recorded(recording))
    assert found.statistic > thresholds.OUTSIDE
    (moment,) = found.moments
    first = MOMENTS[name]["begin_s"] / PERIOD_S
    last = first + MOMENTS[name]["length_s"] / PERIOD_S
    # Three blocks before and after, and the two blocks that the ends lie in.
    assert first - 4 * BLOCK <= moment.start <= first
    assert last <= moment.stop <= last + 4 * BLOCK + 2  # and the delay
    assert not found.force[~found.acts].any()


@pytest.mark.parametrize("device", BENCHES)
@pytest.mark.parametrize("name", MOMENTS)
def test_what_pushed_is_known(name: str, device: str) -> None:
    recording = with_moment(device, name)
    mended = repair_measurement(begun(recording, device)).etfe.recording
    assert mended is not None
    pushed = mended.force - recording.force
    if name == "bump":
        height = BENCHES[device].with_effect("bump").effects[-1].force  # type: ignore[attr-defined]
        # Half a wave: its mean is 2 / pi of its height, whatever noise there is beside it.
        impulse = height * MOMENTS[name]["length_s"] * 2 / np.pi
        assert pushed.sum() * PERIOD_S == pytest.approx(impulse, rel=0.05)
    else:
        first = int(MOMENTS[name]["begin_s"] / PERIOD_S)
        inside = slice(first, first + int(MOMENTS[name]["length_s"] / PERIOD_S))
        assert np.corrcoef(pushed[inside], -recording.force[inside])[0, 1] > 0.6


@pytest.mark.parametrize("device", BENCHES)
@pytest.mark.parametrize("name", MOMENTS)
def test_without_it_the_limit_is_that_of_the_device(name: str, device: str) -> None:
    struck = begun(with_moment(device, name), device)
    mended = repair_measurement(struck)
    assert [effect.name for effect in mended.accepted] == ["outside_force"]
    assert not mended.fit.misfits
    # What something else did was noise before: the first mass is known better without it.
    assert mended.fit.sd[0] < 0.7 * struck.fit.sd[0]
    truth = BENCHES[device].true_critical_stiffness()
    before, after = (
        abs(float(critical_stiffness(one.model, one.fit.theta).value) / truth - 1)
        for one in (struck, mended)
    )
    assert after < before
    # The fit to this recording without any moment is 0.5 % off, and that of the LHIfAM 0.02 %.
    assert after < 0.005


def test_a_law_that_shows_where_the_motion_is_large_is_no_moment() -> None:
    recording = recorded("lhifam, held", ("hardening_connection", ()))
    found = outside(as_recorded(recording))
    assert found.moments == () and found.statistic < thresholds.OUTSIDE


@pytest.mark.parametrize("device", BENCHES)
def test_a_clean_recording_has_none(device: str) -> None:
    found = outside(as_recorded(recorded(device)))
    assert found.moments == () and not found.force.any()


@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("name", ["phantom", "lhifam"])
def test_a_command_that_is_lost_is_found_without_any_noise(name: str, held: bool) -> None:
    """The regression was right of the excited band alone: no force was found, or one of 500 times
    the command."""
    still = replace(Bench.from_device(name, held), encoder_resolution=1e-13)
    band = WhiteNoise(still.force_rms, 200.0, 0.7, SECONDS)
    lost = still.with_effect("lost_command", begin_s=5.0, length_s=0.2)
    whole, found = (
        outside(as_recorded(recording_from_arrays(**simulate(bench, band, seed=2).signals)))
        for bench in (still, lost)
    )
    assert whole.moments == () and whole.statistic < thresholds.OUTSIDE
    (moment,) = found.moments
    assert moment.start < 5000 < 5200 < moment.stop
    missed = -simulate(lost, band, seed=2).force[5000:5200]
    assert np.corrcoef(found.force[5000:5200], missed)[0, 1] > 0.9


def test_without_noise_rounding_is_no_moment() -> None:
    """Where errors are of the last digits those at the beginning are forty times the others."""
    bench = BENCHES["phantom"].quiet()
    made = simulate(bench, WhiteNoise(bench.force_rms, 200.0, 0.7, 10.0), seed=1)
    found = outside(as_recorded(recording_from_arrays(**made.signals)))
    assert found.moments == () and not found.force.any()


def test_a_moment_that_is_refused_leaves_no_force(monkeypatch: pytest.MonkeyPatch) -> None:
    """What no force explains: here a force that explains nothing."""
    monkeypatch.setattr(
        "bayeshaptic.diagnosis.samples.outside._force",
        lambda *given: np.ones(given[2].stop - given[2].start),
    )
    found = outside(as_recorded(with_moment("lhifam, held", "bump")))
    assert found.moments == () and not found.force.any()


def test_what_lasts_is_no_moment() -> None:
    recording = recorded("phantom", ("lost_command", (("begin_s", 4.0), ("length_s", 3.0))))
    assert outside(as_recorded(recording)).moments == ()


def test_the_report_says_when() -> None:
    closed = close_loop(with_moment("phantom", "bump"), device="phantom", held=False, hidden=False)
    assert closed.verdict == "explained" and closed.traced.residual_class == "measurement"
    (effect,) = closed.effects
    assert effect.name == "outside_force" and "from 4.9" in effect.evidence
    begin, end = (effect.estimates[name].mean for name in ("begin_1_s", "end_1_s"))
    assert begin <= 5.0 and end >= 5.15
