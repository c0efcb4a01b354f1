"""R-hat and effective draws are ArviZ's."""

from __future__ import annotations

import arviz as az
import numpy as np
import pytest

from bayeshaptic.numerics.rank_statistics import (
    bulk_size,
    of_ensembles,
    split_rhat,
    tail_size,
)
from bayeshaptic.types import Floats


def _walk(chains: int, draws: int, memory: float, apart: float = 0.0) -> Floats:
    """First-order autoregressive chains, their means `apart` from each other."""
    rng = np.random.default_rng(3)
    steps = rng.standard_normal((chains, draws + 100))
    for i in range(1, steps.shape[1]):
        steps[:, i] += memory * steps[:, i - 1]
    return steps[:, 100:] + apart * np.arange(chains)[:, None]


CASES = {
    "white": _walk(4, 501, 0.0),
    "slow": _walk(4, 2000, 0.95),
    "alternating": _walk(5, 300, -0.7),
    "apart": _walk(3, 400, 0.3, apart=0.5),
    "many short ones": _walk(300, 17, 0.6),
    "heavy tails": np.exp(3 * _walk(4, 800, 0.5)),
    "ties": np.round(_walk(4, 800, 0.5)),
    "four draws": _walk(6, 4, 0.5),
}


@pytest.mark.parametrize("case", CASES)
def test_the_numbers_are_arviz(case: str) -> None:
    chains = CASES[case]
    bulk, tail = az.ess(chains, method="bulk"), az.ess(chains, method="tail", prob=(0.05, 0.95))
    assert split_rhat(chains) == pytest.approx(float(az.rhat(chains)), rel=1e-10)
    assert bulk_size(chains) == pytest.approx(float(bulk), rel=1e-9)
    assert tail_size(chains) == pytest.approx(float(tail), rel=1e-9)


@pytest.mark.parametrize("steps", [40, 41, 4])
def test_ensembles_are_judged_by_one_order_of_their_draws(steps: int) -> None:
    """Each in the order of time for R-hat; each walker a chain for sizes."""
    draws = np.random.default_rng(5).standard_normal((4, steps, 16)).cumsum(axis=1)
    rhat, bulk, tail = of_ensembles(draws)
    even = draws[:, steps % 2 :]
    walkers = even.swapaxes(1, 2).reshape(64, -1)
    assert rhat == split_rhat(even.reshape(4, -1))
    assert (bulk, tail) == (bulk_size(walkers), tail_size(walkers))


def test_what_cannot_be_judged_is_not_praised() -> None:
    constant, broken = np.ones((4, 100)), np.full((4, 100), np.nan)
    assert np.isinf(split_rhat(broken)) and bulk_size(broken) == tail_size(broken) == 0.0
    assert np.isinf(split_rhat(constant))
    assert bulk_size(constant) == constant.size  # as ArviZ says
    assert np.isinf(split_rhat(np.ones((4, 3))))
    assert of_ensembles(np.full((4, 40, 8), np.nan)) == (np.inf, 0.0, 0.0)
