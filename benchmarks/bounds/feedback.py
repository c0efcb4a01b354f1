"""How many closed loops on which noise is played anybody can tell from open ones.

    python -m benchmarks.bounds.feedback [--each 360] [--samples 100000] [--lines FILES...]

Such a loop, and an open one under a force of the same statistics on the same device, differ in one
thing: how the force is drawn, given its own past and the positions that were read. Who knows the
controller, the noise and the device knows both densities, and no test with as few false alarms
misses fewer loops than their likelihood ratio does (J. Neyman and E. S. Pearson, *Phil. Trans. R.
Soc. A* 231, 1933). A sample adds log(1 + v/w) to twice that ratio: v is the variance of what the
force's own past does not foretell of the controller's answers, w that of the noise that is new
(J. Geweke, *JASA* 77, 1982). So the ratio tells both apart by sqrt(N log(1 + v/w)) of its standard
deviations. v is measured on a long run of the same loop under other noise. What is linear in the
force's past foretells no more than all of that past, so that v is at least what is told here.

Loops that follow steps and ramps are left out: next to none of them are missed. `--lines` names
files of `benchmarks.door --keep`, whose verdicts stand beside what nobody sees.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.stats import norm
from tqdm import tqdm

from bayeshaptic.rig import Bench, run_loop
from bayeshaptic.types import Floats
from benchmarks.recordings.controllers import Law
from benchmarks.recordings.door import closed_case

# Rates: one in a hundred, and five standard deviations, where feedback is said.
FALSE_ALARMS = {"1 % of false alarms": 0.01, "five standard deviations": float(norm.sf(5.0))}
# The force's past: samples one by one, then the sums of spans that grow.
_SINGLE, _LONGEST, _AN_OCTAVE = 128, 8192, 8
_AWAY = 1e6  # times the reference's size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--each", type=int, default=360, help="loops, as of benchmarks.door")
    parser.add_argument("--samples", type=int, default=100_000, help="of each loop's long run")
    parser.add_argument("--lines", type=Path, nargs="*", default=[], help="benchmarks.door --keep")
    options = parser.parse_args()
    lines = (json.loads(line) for path in options.lines for line in path.open())
    verdicts = {line["seed"]: line["verdict"] for line in lines if line["closed"]}
    rows = []
    for seed in tqdm(range(options.each), disable=None):
        case = closed_case(seed)
        if case.law is None or case.law.noise is None:
            continue
        apart = separation(case.bench, case.law, case.recording.samples, options.samples)
        rows.append((case.reference, apart, verdicts.get(seed, "")))
        print(f"{seed} {case.kind}, {case.reference}, {case.device}: {apart:.2f} {rows[-1][-1]}")
    show(rows)


def show(rows: list[tuple[str, float, str]]) -> None:
    """What nobody sees, and what was not seen, by what the loops follow."""
    heads = ["loops", "number", *(f"nobody sees, {name}" for name in FALSE_ALARMS), "not seen"]
    print("\n| " + " | ".join(heads) + " |\n|" + " --- |" * len(heads))
    for reference in sorted({row[0] for row in rows}):
        apart = np.array([row[1] for row in rows if row[0] == reference])
        least = [norm.sf(apart - norm.isf(rate)).sum() for rate in FALSE_ALARMS.values()]
        missed = sum(row[0] == reference and row[2] == "open loop" for row in rows)
        cells = "".join(f" {one:.1f} |" for one in least)
        print(f"| {reference} | {len(apart)} |{cells} {missed} |")


def separation(bench: Bench, law: Law, recorded: int, samples: int, seed: int = 0) -> float:
    """Standard deviations between both hypotheses, for who knows everything.

    Parameters
    ----------
    bench : Bench
    law : Law
        On which noise is played.
    recorded : int
        Samples of the recording.
    samples : int
        Of the long run.
    seed : int

    Returns
    -------
    float
    """
    noise = law.noise
    assert noise is not None
    white = np.random.default_rng((5, seed)).standard_normal(samples)
    force, new = long_run(bench, law, noise.of(white), seed), law.gain * noise.new * white
    new = new[: len(force)]
    if len(force) < 2 * _LONGEST:
        return float("inf")  # the loop runs away, and goes by its answers alone
    # Without the noise's low-passes the force's past is as well told, and not collinear.
    for pole in noise.poles:
        force = np.append(force[:1], force[1:] - pole * force[:-1])
    return float(np.sqrt(recorded * np.log1p(_unforetold(force - new, force) / np.var(new))))


def long_run(bench: Bench, law: Law, noise: Floats, seed: int) -> Floats:
    """The force of the same loop under other noise.

    Of a controller that saturates it is the one before its limits, which says more.
    """
    control, asked = replace(law.under(noise), most=np.inf).begin(), []

    def clipped(k: int, position: float) -> float:
        asked.append(control(k, position))
        return float(np.clip(asked[-1], -law.most, law.most))

    run_loop(bench, clipped, len(noise) * bench.period_s, seed, give_up=_AWAY * law.size)
    return np.array(asked)


def _unforetold(signal: Floats, force: Floats) -> float:
    """Variance of what the force's past does not foretell of a signal."""
    edges = [*range(_SINGLE + 1)]
    while edges[-1] < _LONGEST:
        edges.append(round(edges[-1] * 2 ** (1 / _AN_OCTAVE)))
    sums = np.concatenate([[0.0], np.cumsum(force - force.mean())])
    rows = np.arange(edges[-1], len(force))
    # The sum of samples k - high to k - low - 1, for each span.
    past = np.stack([sums[rows - low] - sums[rows - high] for low, high in pairwise(edges)])
    past /= np.linalg.norm(past, axis=1)[:, None]
    wanted = signal[rows] - signal[rows].mean()
    weights = np.linalg.lstsq(past @ past.T, past @ wanted, rcond=1e-14)[0]
    return float(np.sum((wanted - weights @ past) ** 2) / (len(rows) - len(past)))


if __name__ == "__main__":
    main()
