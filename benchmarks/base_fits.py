"""What `thresholds.py` and `acceptance.py` begin with: recordings, a base model fitted to each."""

from __future__ import annotations

from dataclasses import dataclass

from bayeshaptic.diagnosis.base.begun import Begun, begin
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.rig import Bench
from benchmarks.recordings.blind import CASES, recorded


@dataclass(frozen=True)
class Job:
    """One recording, with an effect of the bench or none, and how it is analysed."""

    case: str
    seconds: float
    with_file: bool
    seed: int
    effect: str = ""


def begun_of(job: Job) -> Begun:
    """The recording with the true kind of model fitted, nothing else known but file or delay."""
    device, held = CASES[job.case]
    bench = Bench.from_device(device, held=held)
    if job.effect:
        bench = bench.with_effect(job.effect)
    options = Options(device=device) if job.with_file else Options(delay_s=bench.delay_s)
    return begin(recorded(bench, job.seconds, job.seed), "grasped" if held else "free", options)
