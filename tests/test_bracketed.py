"""Roots in brackets, beside SciPy's."""

import numpy as np
import pytest
from scipy.optimize import elementwise

from bayeshaptic.numerics.bracketed import roots_between

RNG = np.random.default_rng(11)
PLACE = RNG.uniform(0.1, 3.0, 400)
STEEP = 10 ** RNG.uniform(-2, 3, 400)
LOW, HIGH = PLACE * RNG.uniform(0.2, 1.0, 400), PLACE * RNG.uniform(1.0, 4.0, 400)


def bent(x, index):
    return np.tanh(STEEP[index] * (x - PLACE[index])) + 0.3 * (x - PLACE[index]) ** 3


@pytest.mark.parametrize("tolerance", [1e-8, 1e-13])
def test_roots_are_found_in_few_steps(tolerance):
    asked = []

    def counted(x, index):
        asked.append(len(x))
        return bent(x, index)

    found = roots_between(counted, LOW, HIGH, tolerance)
    assert np.all(np.abs(found / PLACE - 1) < 2 * tolerance)
    theirs = elementwise.find_root(
        lambda x, index: bent(x, index.astype(int)),
        (LOW, HIGH),
        args=(np.arange(400.0),),
        tolerances={"xrtol": tolerance},
    )
    assert np.all(np.abs(theirs.x / found - 1) < 4 * tolerance)
    assert sum(asked) <= 1.05 * theirs.nfev.sum()


def test_brackets_at_a_root_and_without_one():
    low, high = np.array([1.0, 0.0, 2.0]), np.array([2.0, 1.0, 3.0])
    found = roots_between(lambda x, index: x - 1.0, low, high, 1e-12)
    assert found[:2].tolist() == [1.0, 1.0]
    assert np.isnan(found[2])
    assert roots_between(lambda x, index: x, low[:0], low[:0], 1e-12).shape == (0,)
