"""A hand moves the device by itself: no force that goes with the sign of the velocity."""

from __future__ import annotations

import numpy as np
from scipy.signal import chirp
from scipy.stats import chi2
from under_a_hand import PERIOD_S, scores_under_a_hand

from bayeshaptic.types import Floats


def test_a_hand_that_moves_faster_than_a_sweep_feigns_no_friction() -> None:
    """At its fast end the sweep hardly moves the device, and the hand decides the sign."""
    time_s = np.arange(20_000) * PERIOD_S

    def sweeps(rng: np.random.Generator) -> Floats:
        length_s = rng.uniform(3, 5)
        return 0.02 * chirp(time_s % length_s, 0.5, length_s, 200.0)

    # Eight standard normal scores each: their squares add up to more once in a thousand. With the
    # hand's own motion in the sign they were 1.6 to 3.0, all of them.
    for name, found in scores_under_a_hand(("sign(v)", "v|v|", "sign(v2)"), sweeps, 8).items():
        assert len(found) == 8
        assert np.sum(np.square(found)) < chi2.ppf(0.999, 8), name
