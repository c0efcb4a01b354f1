"""Calibration and information of the ETFE's windows, on simulated recordings.

    python -m benchmarks.coverage.etfe_calibration [recordings] [--limit RECORDINGS]

For each device and length: the rms of the pulls of a free scale and delay (1 is right), their
widths over the Cramer-Rao bound with the noise known and nothing leaking (1 is the best there is),
with the true response and with the default as reference, and the mean square of the ETFE's error
over its variance (1 is right).  With --limit instead: how often the 90 % interval of the critical
stiffness read from the ETFE alone covers the truth, for devices drawn from the priors and for those
of the tables.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests" / "references"))

from linear_bench import (
    LHIFAM_FREE,
    LHIFAM_HELD,
    PHANTOM_FREE,
    PHANTOM_HELD,
    Device,
    tremor_density,
)
from scale_and_delay import PERIOD, cramer_rao, record, scale_and_delay

from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.stability import etfe_critical_stiffness
from benchmarks.coverage.calibration import CASES, truth_and_bench

DEVICES = {
    "LHIfAM free": (LHIFAM_FREE, 1.0, 5e-7),
    "LHIfAM held": (LHIFAM_HELD, 1.0, 5e-7),
    "PHANToM free": (PHANTOM_FREE, 0.02, 5e-5),
    "PHANToM held": (PHANTOM_HELD, 0.02, 5e-5),
}
LENGTHS = {2000: None, 5000: (0.7, 200.0), 30000: None}


def main(recordings: int) -> None:
    print(f"{'':14} {'s':>4}  pull rms          width / bound     default reference  ETFE")
    for name, (chain, force, encoder) in DEVICES.items():
        for samples, band_hz in LENGTHS.items():
            row = campaign(Device(chain), force, encoder, samples, band_hz, recordings)
            cells = "  ".join(f"{a:7.3f} {b:7.3f} " for a, b in row[:-1])
            print(f"{name:14} {samples * PERIOD:4.0f}  {cells}  {row[-1]:.3f}", flush=True)


def campaign(device, force, encoder, samples, band_hz, recordings):
    hand = 0.2

    def density(frequency):
        hands = np.abs(device.response(frequency, device.n - 1)) ** 2
        return hands * (hand * force) ** 2 * tremor_density(frequency, PERIOD) + encoder**2

    pulls, widths, default, squares = [], [], [], []
    for seed in range(recordings):
        recording = record(device, np.random.default_rng(seed), samples, force, encoder, hand)
        etfe = estimate_etfe(recording, band_hz)
        theta, sd = scale_and_delay(compress(etfe, device.response), device.response)
        bound = cramer_rao(recording, etfe.band_hz, device.response, density)
        pulls.append(theta / sd)
        widths.append(sd / bound)
        default.append(scale_and_delay(compress(etfe), device.response)[1] / bound)
        error = etfe.value - device.response(etfe.frequency_hz)
        squares.append(np.mean(np.abs(error) ** 2 / etfe.variance))
    return (
        np.sqrt(np.mean(np.square(pulls), axis=0)),
        np.median(widths, axis=0),
        np.median(default, axis=0),
        np.mean(squares),
    )


def limits(recordings: int) -> None:
    """Coverage of K_CR read from the ETFE; the pull is that of its logarithm."""
    print(f"{'':16} {'truth':6} {'s':>3}   read   covered  K below  K above  width %  pull")
    for seconds in (10.0, 30.0):
        everything = []
        for case in CASES:
            for drawn in (True, False):
                found = [_limit(case, seed, seconds, drawn) for seed in range(recordings)]
                read = np.array([row for row in found if row[1] is not None], float)
                if drawn:
                    everything.append(read)
                _print_limits(case, "prior" if drawn else "table", seconds, read, recordings)
        together = np.concatenate(everything)
        _print_limits("all", "prior", seconds, together, recordings * len(CASES))


def _limit(case: str, seed: int, seconds: float, drawn: bool) -> tuple:
    """Truth and the 5, 50 and 95 % quantiles of one recording."""
    bench = truth_and_bench(case, 5000 + seed)[2]
    if not drawn:
        device, structure = case.split()
        bench = Bench.from_device(device, held=structure == "grasped")
    low_hz, high_hz = bench.band_hz
    excitation = WhiteNoise(bench.force_rms, high_hz, low_hz, seconds)
    made = simulate(bench, excitation, seed=9000 + seed)
    etfe = estimate_etfe(recording_from_arrays(**made.signals))
    own = etfe_critical_stiffness(etfe, seed=seed)
    return bench.true_critical_stiffness(), own.q05, own.q50, own.q95


def _print_limits(case: str, truth: str, seconds: float, read: np.ndarray, of: int) -> None:
    below, above = read[:, 0] < read[:, 1], read[:, 0] > read[:, 3]
    width = np.log(read[:, 3] / read[:, 1]) / 3.29
    pull = np.abs(np.log(read[:, 2] / read[:, 0])) / width
    print(
        f"{case:16} {truth:6} {seconds:3.0f} {len(read):4d}/{of:<4d} "
        f"{1 - np.mean(below | above):6.1%}  {below.mean():6.1%}   {above.mean():6.1%}   "
        f"{100 * np.median(width):6.2f}  {np.median(pull) / 0.6745:5.2f}",
        flush=True,
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("recordings", type=int, nargs="?", default=100)
    parser.add_argument("--limit", type=int, metavar="RECORDINGS")
    asked = parser.parse_args()
    if asked.limit:
        limits(asked.limit)
    else:
        main(asked.recordings)
