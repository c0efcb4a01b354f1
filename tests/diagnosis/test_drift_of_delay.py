"""A loop that gets later during a recording, and drifts that it is not."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest
from on_the_bench import recorded_on, usual_noise
from scipy.signal import butter, sosfilt

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.drift import drift_trials
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench
from bayeshaptic.rig.effects.effect import Effect
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class LaterFrom(Effect):
    """Commands act a share of a period later from some moment on: exactly so, as they are held."""

    name: ClassVar[str] = "later_from"
    share: float = 0.3
    moment: float = 0.45

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        share = np.where(progress > self.moment, self.share, 0.0)
        return np.asarray((1 - share) * force + share * np.append(0.0, force[:-1]))


@dataclass(frozen=True)
class Fading(Effect):
    """Slow commands lose more and more, fast ones nothing: on average a gain that falls."""

    name: ClassVar[str] = "fading"

    def command(self, force: Floats, progress: Floats, time_s: Floats) -> Floats:
        slow = sosfilt(butter(1, 30.0, fs=1 / (time_s[1] - time_s[0]), output="sos"), force)
        return np.asarray(force - 0.3 * progress * slow)


def recorded(bench: Bench) -> Recording:
    return recorded_on(bench, usual_noise(bench, 30.0), seed=3)


@pytest.mark.parametrize("told", [True, False])
def test_a_delay_that_changes_is_named_and_the_latest_counts(told: bool) -> None:
    # A device that changes was named before, and the limit of the better half was in green.
    bench = Bench.from_device("phantom", held=True)
    recording = recorded(bench.with_effect(LaterFrom()))
    later = replace(bench, delay_s=bench.delay_s + 0.3 * bench.period_s).true_critical_stiffness()
    delay_s = bench.delay_s if told else None
    closed = close_loop(recording, "grasped", hidden=False, delay_s=delay_s)
    assert [effect.name for effect in closed.effects] == ["delay_drift"]
    change = closed.effects[0].estimates["change_of_delay_s"].mean
    assert change == pytest.approx(0.3 * bench.period_s, rel=0.1)
    low, high = closed.analysis.limit.quantile(0.005), closed.analysis.limit.quantile(0.995)
    assert low < later < high
    stiffness = headline(closed).stiffness
    assert stiffness is not None and stiffness < later


def test_a_drift_of_another_kind_does_not_explain_all_parts() -> None:
    bench = Bench.from_device("lhifam", held=False).with_effect("gain_drift", ratio=0.8)
    etfe = estimate_etfe(recorded(bench))
    state = State(etfe, least_squares(build_model("free", "lhifam"), etfe))
    trials = {trial.name: trial for trial in drift_trials(state, Meter())}
    assert trials["device_drift"].convincing, "it gains enough in the parts that are seen"
    assert not trials["device_drift"].all_along
    assert trials["gain_drift"].convincing and trials["gain_drift"].all_along


def test_a_gain_that_convinces_is_none_where_the_steadied_recording_still_changes() -> None:
    # A damper that warms was named a gain, with 1.64 times the limit.
    etfe = estimate_etfe(recorded(Bench.from_device("lhifam", held=False).with_effect(Fading())))
    state = State(etfe, least_squares(build_model("free", "lhifam"), etfe))
    trials = {trial.name: trial for trial in drift_trials(state, Meter())}
    assert trials["gain_drift"].convincing and not trials["gain_drift"].all_along
