"""Does what a study says of its users depend on the seed?  The same studies, several seeds.

    python -m benchmarks.coverage.seeds [STUDY ...] [--seeds 4] [--keep FOLDER]

Studies of six users on the virtual bench, 10 s a recording: of the PHANToM-like device with its
file ("file") and without ("none"), and of the LHIfAM-like one, everybody twice ("twice").  A seed
is that of the recordings' own chains and of all that the study makes of them.  Shown is how far
quantiles of each limit lie apart between seeds, in standard deviations of that limit, and the CPU
time of a study after its recordings.
"""

from __future__ import annotations

import argparse
import os
import pickle
import time
from pathlib import Path

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import numpy as np  # noqa: E402

import bayeshaptic as bh  # noqa: E402
from bayeshaptic.recordings.study import StudyEntry  # noqa: E402
from bayeshaptic.rig import WhiteNoise, simulate  # noqa: E402
from bayeshaptic.study.analysed import Analysed  # noqa: E402
from bayeshaptic.study.cases import study_cases  # noqa: E402
from benchmarks.coverage.population import held_by, people  # noqa: E402

USERS, SECONDS = 6, 10.0
STUDIES = {  # device, whether its file is known, recordings a user, whose hands
    "file": ("phantom", True, 1, 11),
    "none": ("phantom", False, 1, 13),
    "twice": ("lhifam", True, 2, 12),
}
TRIALS = 0.03  # spread of a hand from one recording to the next, of logarithms
LEVELS = 0.01, 0.05, 0.5, 0.95


def analysed(study: str, seed: int) -> list[Analysed]:
    """The recordings of a study, each analysed by itself."""
    device, file, each, whose = STUDIES[study]
    bench, hands = people(device, whose)
    told = {"device": device} if file else {"delay_s": bench.delay_s}
    rng = np.random.default_rng(whose)
    found = []
    for number, hand in enumerate(np.repeat(hands[:USERS], each, axis=0)):
        user, trial = divmod(number, each)
        if each > 1:
            hand = hand * np.exp(TRIALS * rng.standard_normal(len(hand)))
        noise = WhiteNoise(bench.force_rms, bench.band_hz[1], seconds=SECONDS)
        made = simulate(held_by(bench, hand), noise, seed=1000 * whose + 10 * user + trial)
        recording = bh.recording_from_arrays(**made.signals)
        entry = StudyEntry(Path(f"{user}-{trial}.csv"), user=str(user))
        result = bh.analyse(recording, "grasped", seed=seed, **told)
        found.append(Analysed(entry.path.stem, entry, result))
    return found


def limits(study: str, seed: int, keep: Path | None) -> tuple[dict[str, np.ndarray], float]:
    """Quantiles of every case and of the device at `LEVELS`, and CPU seconds; kept in a folder."""
    file = keep / f"{study}-{seed}.pickle" if keep else None
    if file and file.exists():
        return pickle.loads(file.read_bytes())
    recordings = analysed(study, seed)
    began = time.process_time()
    whole = study_cases(recordings, seed, lambda share, word: None)
    found = {case.label: case.limit.quantile(np.array(LEVELS)) for case in whole.cases}
    if whole.limit is not None:
        found["the device"] = whole.limit.quantile(np.array(LEVELS))
    done = found, time.process_time() - began
    if file:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(pickle.dumps(done))
    return done


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("study", nargs="*", help=f"of {', '.join(STUDIES)}; all by default")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--keep", type=Path, help="folder for the outcomes: goes on from there")
    asked = parser.parse_args()
    for study in asked.study or STUDIES:
        done = [limits(study, seed, asked.keep) for seed in range(1, asked.seeds + 1)]
        print(f"{study}: {np.mean([seconds for _, seconds in done]):.0f} s of CPU a study")
        for label in done[0][0]:
            found = np.array([one[label] for one, _ in done])
            sd = np.mean(found[:, 3] - found[:, 1]) / 3.29
            apart = np.ptp(found, axis=0) / sd
            told = ", ".join(f"{p:.0%} {far:.2f}" for p, far in zip(LEVELS, apart, strict=True))
            print(f"  {label:20s} median {found[:, 2].mean():9.5g}, apart: {told}", flush=True)


if __name__ == "__main__":
    main()
