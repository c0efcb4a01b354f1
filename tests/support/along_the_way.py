"""Two masses of another simulation, with forces that depend on where the motor is."""

from __future__ import annotations

import numpy as np
from scipy.signal import butter, sosfilt

from bayeshaptic.recordings import Recording, recording_from_arrays
from benchmarks.strangers.device import Masses
from benchmarks.strangers.motion import STEPS, Forces, Motion

PERIOD_S, DELAY_S = 1e-3, 2.5e-4  # whole steps of the simulation


def guided(forces: Forces, seconds: float = 10.0) -> tuple[Recording, float]:
    """A recording under white noise, and the limit of the device without these forces."""
    pair = Masses([0.19, 5.2])
    pair.tie(0, None, 0.1, 0.0)
    pair.tie(0, 1, 15.0, 55.3e3)
    pair.tie(1, None, 6.8, 0.0)
    device = pair.states()
    transition, entry, entries = device.held(PERIOD_S / STEPS)
    samples = int(seconds / PERIOD_S)
    late = round(DELAY_S / PERIOD_S * STEPS)
    motion = Motion(transition[None], samples, entry, entries, device.c, late)
    noise = np.random.default_rng(1).normal(size=samples)
    force = 4.0 * sosfilt(butter(2, [0.3, 300.0], "band", fs=1 / PERIOD_S, output="sos"), noise)
    position = motion.under(force, np.zeros(samples), forces)
    count = 3e-6
    recording = recording_from_arrays(force, count * np.round(position / count), period_s=PERIOD_S)
    return recording, device.critical_stiffness(PERIOD_S, DELAY_S)
