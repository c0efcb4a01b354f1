"""A table of a frequency response, from arrays."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import bayeshaptic as bh
from bayeshaptic.types import Complexes, Floats


def noisy_table(
    folder: Path, frequency_hz: Floats, response: Complexes, relative_sd: float, seed: int
) -> bh.Etfe:
    """The response of a loop of 1 kHz, written with noise and read again; m/N."""
    noise = np.random.default_rng(seed).normal(size=(2, len(response))) / np.sqrt(2)
    response = response * (1 + relative_sd * (noise[0] + 1j * noise[1]))
    gain_db, phase_deg = 20 * np.log10(np.abs(response)), np.angle(response, deg=True)
    rows = np.stack([frequency_hz, gain_db, phase_deg, relative_sd * np.abs(response)], axis=1)
    path = folder / "table.csv"
    np.savetxt(path, rows, delimiter=",", header="frequency_hz,gain_db,phase_deg,sd", comments="")
    return bh.read_frf(path, period_s=1e-3, kind="translational")
