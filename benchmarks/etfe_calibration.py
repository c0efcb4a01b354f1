"""Calibration and information of the ETFE's windows, on simulated recordings.

    python benchmarks/etfe_calibration.py [recordings]

For each device and length: the rms of the pulls of a free scale and delay (1 is right), their
widths over the Cramer-Rao bound with the noise known and nothing leaking (1 is the best there is),
with the true response and with the default as reference, and the mean square of the ETFE's error
over its variance (1 is right).
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from linear_bench import (
    LHIFAM_FREE,
    LHIFAM_HELD,
    PHANTOM_FREE,
    PHANTOM_HELD,
    Device,
    tremor_density,
)
from test_windows import PERIOD, cramer_rao, record, scale_and_delay

from bayeshaptic.recordings.etfe import estimate_etfe
from bayeshaptic.recordings.windows import compress

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


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100)
