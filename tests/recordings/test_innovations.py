"""Whether what is new in a force answers to what was new in the position before."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from scipy.stats import kstest

from bayeshaptic.recordings.signals.causality.innovations import innovations_answer
from bayeshaptic.recordings.signals.causality.prediction import Prediction
from bayeshaptic.rig import Bench
from bayeshaptic.types import Floats
from benchmarks.bounds.feedback import separation
from benchmarks.recordings.controllers import Law, LowPassed

SAMPLES = 3000


def left(own: Floats) -> Prediction:
    """What a prediction leaves."""
    none = np.zeros((4, len(own)))
    half = np.zeros(len(own), bool)
    return Prediction(own, own, np.ones(len(own)), none, half, np.arange(len(own)))


def answers(foretold: float, fed_back: float = 0.0) -> Floats:
    """Of 300 pairs of innovations; those of the position foretell each other."""
    rng = np.random.default_rng(3)
    found = []
    for _ in range(300):
        force, new = rng.standard_normal((2, SAMPLES))
        position = np.asarray(lfilter([np.sqrt(1 - foretold**2)], [1, -foretold], new))
        force[4:] -= fed_back * position[:-4]
        found.append(innovations_answer(left(force), left(position)))
    return np.array(found)


def test_in_open_loop_the_answer_is_chance_however_the_position_foretells_itself() -> None:
    usual, slow = answers(0.0), answers(0.97)
    for found in (usual, slow):
        assert not np.any(found > 30.0)  # from where on a recording is doubted
        assert abs(found.mean() - 6.5) < 4 * np.sqrt(13 / 300)  # six spans, and half of another
    assert kstest(usual, slow).pvalue > 1e-3


def test_an_answer_is_seen() -> None:
    assert np.mean(answers(0.0, fed_back=0.3) > 40.0) > 0.9


def test_what_nobody_can_tell_is_known_where_it_can_be_written_down() -> None:
    """A device too heavy to move: what the controller answers to is the noise of its sensor."""
    pole, read, stiffness, force, samples = 0.5, 1e-6, 1e4, 0.02, 40_000
    bench = Bench("rigid", {"m": 1e9, "b": 1.0}, sensor_noise_rms=read)
    white = np.random.default_rng(1).standard_normal(samples)
    added, noise = LowPassed.of_size(force, (pole,), white)
    still = np.zeros(samples)
    law = Law(stiffness, 0.0, 0.0, np.inf, pole, False, 1e-3, still, added, 1.0, noise)
    # The filter of the position has the pole of the noise, so both are white beside each other.
    share = (stiffness * (1 - pole) * read / noise.new) ** 2
    told = separation(bench, law, recorded=1000, samples=samples)
    # v is a mean of 40,000 squares, and the root halves its error.
    assert abs(told / np.sqrt(1000 * np.log1p(share)) - 1) < 5 * 0.5 * np.sqrt(2 / 30_000)
