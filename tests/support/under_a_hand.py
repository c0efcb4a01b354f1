"""Scores of the tests for forces, of a held linear device that the hand moves by itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from linear_bench import PHANTOM_HELD, Device, tremor

from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.types import Floats

PERIOD_S = 1e-3


def scores_under_a_hand(
    names: Sequence[str], force_of: Callable[[np.random.Generator], Floats], recordings: int
) -> dict[str, list[float]]:
    """Of so many recordings, under the force that a generator makes; by the name of the test."""
    device, count = Device(PHANTOM_HELD), 6e-5
    model = build_model("grasped", "phantom")
    scores: dict[str, list[float]] = {name: [] for name in names}
    for seed in range(recordings):
        rng = np.random.default_rng(seed)
        force = force_of(rng)
        hand = 0.01 * tremor(rng, len(force), PERIOD_S)
        position = device.simulate(force) + device.simulate(hand, 2)
        recording = recording_from_arrays(
            force=force,
            position=np.round(position / count) * count,
            period_s=PERIOD_S,
            force_unit="Nm",
            position_unit="rad",
        )
        etfe = estimate_etfe(recording)
        fit = least_squares(model, etfe, start=model.values)
        for test in nonlinear_tests(fit, etfe):
            if test.name in scores:
                scores[test.name].append(test.statistic)
    return scores
