"""Devices of two masses and hands in closed loop: how often the intervals hold what the bench was.

    python -m benchmarks.through_reference [COUNT] [FILE] [--without-reference | --dithered]

LHIfAM- and PHANToM-like devices, free and held, under five controllers that follow steps, ramps or
noise, 2 to 30 s, every other one with dry friction.  References of noise are written down beside
the force; where they step or ramp, the controller is read off the recording.  Each recording takes
the whole way to a recommendation.  Without their references, those that follow noise alone: the
direct method.  Dithered, noise that nobody wrote down is added to the command of a controller that
holds a place, and hands wander with 0.03 to 1 of the device's usual force.  FILE keeps what is
done, a line a recording: a run that was stopped goes on from there.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.errors import InputError
from bayeshaptic.models import Model
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, run_loop
from bayeshaptic.types import Floats
from benchmarks.bounds import held, two_masses
from benchmarks.recordings.controllers import Law, controller_of
from benchmarks.recordings.door import written_down

CONTROLLERS = ("P", "PD", "PI", "PID", "PD filtered")
REFERENCES = ("steps", "ramps", "noise")
FEWEST_COUNTS, FARTHEST = 20.0, 20.0
BOUNDS = {"over_bound": "", "over_bound_of_any_noise": " where noise has any spectrum"}


@dataclass(frozen=True)
class Case:
    """A recording with its reference, the bench without friction, and what they are in words.

    `law` made the command, and `true_position` is what the encoder counted.
    """

    recording: Recording
    bench: Bench
    friction: float
    what: str
    law: Law
    true_position: Floats

    @property
    def rounding(self) -> Floats:
        """What the encoder added to the position, shape (N,)."""
        return self.recording.position - self.true_position[: self.recording.samples]

    def without_noise(self) -> Recording:
        """The same loop with a hand that keeps still and an encoder without counts."""
        still = replace(self.bench, wander_rms=0.0, tremor_rms=0.0, encoder_resolution=0.0)
        still = replace(still, sensor_noise_rms=0.0)
        made = run_loop(still, self.law.begin(), len(self.law.wanted) * still.period_s)
        return written_down(made.force, made.position, still, "at the sample")


def make(seed: int, dithered: bool = False) -> Case:
    """One recording; controllers and references in turn."""
    rng = np.random.default_rng((12, seed))
    kind, reference = CONTROLLERS[seed % 5], REFERENCES[seed // 5 % 3]
    if dithered:
        reference = "wall with dither"
    while True:
        name, held = str(rng.choice(["lhifam", "phantom"])), bool(rng.random() < 0.5)
        bench = Bench.from_device(name, held, "grasped" if held else "free")
        values = {key: v * float(np.exp(rng.normal(0, 0.3))) for key, v in bench.values.items()}
        delay_s = float(rng.uniform(0, 2)) * bench.period_s
        bench = replace(bench, values=values, delay_s=delay_s)
        if dithered and held:
            wander = float(10 ** rng.uniform(-1.5, 0.0))
            bench = replace(bench, wander_rms=wander * bench.force_rms)
        friction = bench.force_rms * float(10 ** rng.uniform(-1.5, -0.5)) * (seed % 2)
        rubbing = bench.with_effect("coulomb_friction", force=friction) if friction else bench
        seconds = float(np.exp(rng.uniform(np.log(2), np.log(30))))
        law = controller_of(kind, reference, bench, seconds, rng, "at the sample")
        made = run_loop(rubbing, law.begin(), seconds, seed, give_up=FARTHEST * law.size)
        whole = len(made.force) >= round(seconds / bench.period_s) - 1
        if whole and np.ptp(made.position) > FEWEST_COUNTS * bench.encoder_resolution:
            break
    recording = written_down(made.force, made.position, bench, "at the sample")
    if reference == "noise":
        recording = replace(recording, reference=law.wanted[: recording.samples])
    what = f"{name} {'held' if held else 'free'}, {kind}, {reference}, {seconds:.1f} s"
    return Case(recording, bench, friction / bench.force_rms, what, law, made.true_position)


def one(seed: int, without: bool = False, dithered: bool = False) -> dict[str, Any]:
    """What became of one recording, without its reference or with it."""
    case = make(seed, dithered)
    if without:
        case = replace(case, recording=replace(case.recording, reference=None))
    found: dict[str, Any] = {"seed": seed, "what": case.what, "friction": case.friction}
    began = time.process_time()
    try:
        closed = close_loop(case.recording, hidden=False)
    except InputError as error:
        return found | {"outcome": "refused", "why": str(error)}
    found["seconds"] = time.process_time() - began
    analysis, told = closed.analysis, headline(closed)
    truth = case.bench.true_critical_stiffness()
    low, middle, high = (float(analysis.limit.quantile(p)) for p in (0.05, 0.5, 0.95))
    found |= {
        "outcome": "refused" if told.status == "untrusted" else "recommended",
        "why": told.sentence,
        "through": analysis.etfe.through_reference or analysis.etfe.direct,
        "throughout": analysis.etfe.moved_throughout,
        "stiffness": told.stiffness and told.stiffness / truth,
        "model": analysis.model.name,
        "verdict": closed.verdict,
        "flags": [test.name for test in closed.traced.after if test.flagged],
        "limit_db": [20 * float(np.log10(max(v, 1e-12) / truth)) for v in (low, middle, high)],
        "ranks": _ranks(analysis.posterior.draws, analysis.model, case.bench),
    }
    if case.bench.mechanism == analysis.model.name and not case.friction:
        sd = float(np.std(20 * np.log10(analysis.limit.samples)))
        found |= {name: sd / bound for name, bound in _bounds(case, analysis.model).items()}
    return found


def _bounds(case: Case, model: Model) -> dict[str, float]:
    """Of K_CR's standard deviation in dB; of held devices also where noise has any spectrum."""
    recording, bench = case.recording, case.bench
    if bench.mechanism == "free":
        return {"over_bound": two_masses.bound_db(recording, bench, model)}
    known, quiet = (
        held.bound_db(one, bench, model, case.rounding) for one in (recording, case.without_noise())
    )
    return {"over_bound": known, "over_bound_of_any_noise": quiet}


def _ranks(draws: Floats, model: Model, bench: Bench) -> dict[str, float]:
    truth = {**bench.values, "delay_s": bench.delay_s}
    return {
        name: float(np.mean(draws[:, i] < truth[name]))
        for i, name in enumerate(model.names)
        if truth.get(name, 0.0) > 0
    }


def summary(found: list[dict[str, Any]]) -> None:
    """Print what the intervals held."""
    for label, friction in (("without dry friction", False), ("with dry friction", True)):
        some = [one for one in found if (one["friction"] > 0) == friction]
        told = [one for one in some if one["outcome"] == "recommended"]
        through = [one for one in told if one["through"]]
        print(
            f"{label}: {len(some)} recordings, {len(told)} recommended, {len(through)} of them "
            "through the reference, or by the direct method"
        )
        if not through:
            continue
        held = [one["limit_db"][0] <= 0 <= one["limit_db"][2] for one in through]
        above = [one["limit_db"][0] > 0 for one in through]
        widths = [one["limit_db"][2] - one["limit_db"][0] for one in through]
        ranks = np.array([rank for one in through for rank in one["ranks"].values()])
        inside = np.mean((ranks > 0.05) & (ranks < 0.95))
        print(
            f"  K_CR's 90 % interval holds the truth in {100 * np.mean(held):.0f} %, lies above it "
            f"in {100 * np.mean(above):.0f} %; median width {np.median(widths):.2g} dB; the "
            f"parameters' in {100 * inside:.0f} % of {len(ranks)}"
        )
    told = [one for one in found if one["outcome"] == "recommended" and "over_bound" in one]
    for key, what in BOUNDS.items():
        for kind in ("free", "held"):
            some = [one for one in told if f" {kind}, " in one["what"] and key in one]
            ratios = np.array([one[key] for one in some])
            if len(ratios):
                print(
                    f"sd of K_CR over the Cramer-Rao bound{what}, {kind} devices: median "
                    f"{np.median(ratios):.2f} of {len(ratios)}, below 1.25 in "
                    f"{100 * np.mean(ratios < 1.25):.0f} %"
                )


def main(count: int, path: Path, without: bool, dithered: bool) -> None:
    """Run what is not in the file yet, and print what all say."""
    kept = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    done = {one["seed"] for one in kept}
    for seed in range(count):
        follows_noise = REFERENCES[seed // 5 % 3] == "noise"
        if seed in done or (without and not follows_noise):
            continue
        kept.append(one(seed, without, dithered))
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(kept[-1]) + "\n")
        print(seed, kept[-1]["what"], kept[-1]["outcome"], kept[-1].get("limit_db"), flush=True)
    summary(kept)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=200)
    parser.add_argument("file", nargs="?", type=Path, default=Path("through-reference.jsonl"))
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--without-reference", action="store_true", help="as if nobody knew it")
    which.add_argument("--dithered", action="store_true", help="noise in the command of a hold")
    asked = parser.parse_args()
    main(asked.count, asked.file, asked.without_reference, asked.dithered)
