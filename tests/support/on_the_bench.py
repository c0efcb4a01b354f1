"""Recordings of the virtual bench, with the count of the encoder that made them."""

from __future__ import annotations

from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.rig.excitation import Excitation


def recorded_on(bench: Bench, excitation: Excitation, seed: int) -> Recording:
    made = simulate(bench, excitation, seed=seed)
    return recording_from_arrays(**made.signals, encoder_resolution=bench.encoder_resolution)


def usual_noise(bench: Bench, seconds: float) -> WhiteNoise:
    """White noise at the bench's usual level, in its usual band."""
    low, high = bench.band_hz
    return WhiteNoise(bench.force_rms, high, low, seconds)
