"""A rigid device, and the model that is right."""

from __future__ import annotations

from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import rigid
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise, simulate


def right_fit() -> Fit:
    """The fit to twenty seconds of white noise."""
    bench = Bench("rigid", {"m": 2.0, "b": 20.0}, delay_s=5e-4, encoder_resolution=1e-6)
    made = simulate(bench, WhiteNoise(5.0, 400.0, 0.5, 20.0), seed=3)
    recording = recording_from_arrays(**made.signals)
    return least_squares(rigid(period_s=1e-3), estimate_etfe(recording))
