"""R-hat and effective draws are ArviZ's."""

from __future__ import annotations

import numpy as np
import pytest

from bayeshaptic.inference.saved.arviz_groups import import_arviz
from bayeshaptic.numerics.rank_statistics import of_ensembles, split_rhat
from bayeshaptic.types import Floats

az = import_arviz()


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


def _sizes(chains: Floats) -> tuple[float, float]:
    """Bulk and tail, every chain a walker of one ensemble."""
    return of_ensembles(chains.T[None])[1:]


@pytest.mark.parametrize("case", CASES)
def test_the_numbers_are_arviz(case: str) -> None:
    chains = CASES[case]
    assert split_rhat(chains) == pytest.approx(float(az.rhat(chains)), rel=1e-10)
    even = chains[:, chains.shape[1] % 2 :]
    bulk, tail = az.ess(even, method="bulk"), az.ess(even, method="tail", prob=(0.05, 0.95))
    assert _sizes(chains) == pytest.approx((float(bulk), float(tail)), rel=1e-9)
    assert of_ensembles(chains[..., None])[0] == pytest.approx(float(az.rhat(even)), rel=1e-10)


@pytest.mark.parametrize("steps", [40, 41, 4])
def test_ensembles_are_judged_by_one_order_of_their_draws(steps: int) -> None:
    """Each in the order of time for R-hat; each walker a chain for sizes."""
    draws = np.random.default_rng(5).standard_normal((4, steps, 16)).cumsum(axis=1)
    even = draws[:, steps % 2 :]
    walkers = even.swapaxes(1, 2).reshape(64, -1)
    rhat, *sizes = of_ensembles(draws)
    assert rhat == pytest.approx(float(az.rhat(even.reshape(4, -1))), rel=1e-10)
    found = [az.ess(walkers, method="bulk"), az.ess(walkers, method="tail", prob=(0.05, 0.95))]
    assert sizes == pytest.approx([float(one) for one in found], rel=1e-9)


def test_what_cannot_be_judged_is_not_praised() -> None:
    constant, broken = np.ones((4, 100)), np.full((4, 100), np.nan)
    assert np.isinf(split_rhat(broken)) and _sizes(broken) == (0.0, 0.0)
    assert np.isinf(split_rhat(constant))
    assert _sizes(constant)[0] == constant.size  # as ArviZ says
    assert np.isinf(split_rhat(np.ones((4, 3))))
    assert of_ensembles(np.full((4, 40, 8), np.nan)) == (np.inf, 0.0, 0.0)
