"""Table IV: relay experiments on the bench, beside the models and the paper's measurements."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.models import build_model
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.rig import Bench, run_relay
from bayeshaptic.stability import RelayCheck, RelayMeasurement, check_relay, measure_relay

from .identification import logged
from .published import CASES, relays

SWINGS_RAD = (0.01, 0.02, 0.05, 0.1)  # where the free PHANToM is let go


@dataclass(frozen=True)
class RelayRun:
    """One simulated relay experiment."""

    case: tuple[str, str]
    recording: Recording = field(repr=False)
    measured: RelayMeasurement
    check: RelayCheck

    @property
    def published(self) -> tuple[np.ndarray, np.ndarray]:
        return relays(*self.case)


def relay_runs() -> list[RelayRun]:
    """One experiment of 30 s a case, from rest."""
    return [_run(case) for case in CASES]


def let_go() -> list[RelayRun]:
    """The free PHANToM, let go at several angles: where a sampled relay may settle."""
    return [_run(("phantom", "free"), angle) for angle in SWINGS_RAD]


def _run(case: tuple[str, str], swing: float = 0.0) -> RelayRun:
    device, name = case
    bench = Bench.from_device(device, held=name == "grasped")
    start = {"m1": (swing, 0.0), "m2": (swing, 0.0)} if swing else None
    recording = logged(run_relay(bench, seconds=30.0, seed=4, start=start))
    measured = measure_relay(recording)
    return RelayRun(case, recording, measured, check_relay(measured, build_model(name, device)))
