"""A hand moves the device by itself: no force that goes with the sign of the velocity."""

from __future__ import annotations

import numpy as np
from linear_bench import PHANTOM_HELD, Device, tremor
from scipy.signal import chirp
from scipy.stats import chi2

from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe


def test_a_hand_that_moves_faster_than_a_sweep_feigns_no_friction() -> None:
    """At its fast end the sweep hardly moves the device, and the hand decides the sign."""
    device, period_s, samples, count = Device(PHANTOM_HELD), 1e-3, 20_000, 6e-5
    model, time_s = build_model("grasped", "phantom"), np.arange(20_000) * 1e-3
    scores: dict[str, list[float]] = {"sign(v)": [], "v|v|": [], "sign(v2)": []}
    for seed in range(8):
        rng = np.random.default_rng(seed)
        length_s = rng.uniform(3, 5)
        force = 0.02 * chirp(time_s % length_s, 0.5, length_s, 200.0)
        hand = 0.01 * tremor(rng, samples, period_s)
        position = device.simulate(force) + device.simulate(hand, 2)
        recording = recording_from_arrays(
            force=force,
            position=np.round(position / count) * count,
            period_s=period_s,
            force_unit="Nm",
            position_unit="rad",
        )
        etfe = estimate_etfe(recording)
        fit = least_squares(model, etfe, start=model.values)
        for test in nonlinear_tests(fit, etfe):
            if test.name in scores:
                scores[test.name].append(test.statistic)
    # Eight standard normal scores each: their squares add up to more once in a thousand. With the
    # hand's own motion in the sign they were 1.6 to 3.0, all of them.
    for name, found in scores.items():
        assert len(found) == 8
        assert np.sum(np.square(found)) < chi2.ppf(0.999, 8), name
