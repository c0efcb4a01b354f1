"""Which parameter vectors a limit is computed for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.models.model import Model
from bayeshaptic.stability.crossings import rational
from bayeshaptic.types import Floats

MOST_DRAWS = 150_000
MOST_SEARCHED = 30_000  # of a loop without a finite set of poles, whose search is slow


def draws_of(posterior: Any) -> Floats:
    """The draws of a posterior in the order of the samples of its `critical_stiffness`."""
    return vectors_of(posterior, None, None)[0]


def most_draws(model: Model, vector: Floats) -> int:
    """How many draws `critical_stiffness` looks at, for parameters like `vector`, shape (P,)."""
    return MOST_DRAWS if rational(model.system(vector[None])) else MOST_SEARCHED


def vectors_of(source: Any, theta: ArrayLike | None, max_draws: int | None) -> tuple[Floats, int]:
    """Parameter vectors, chain after chain, and the number of chains."""
    chains = getattr(source, "chains", None)
    if theta is not None or chains is None:
        if theta is None:
            theta = source.values if isinstance(source, Model) else source.theta
        vectors = np.atleast_2d(np.asarray(theta, float))
        return vectors, len(vectors)
    chains = np.asarray(chains)  # (E, S, W, P)
    most = max_draws or most_draws(source.model, chains[0, 0, 0])
    every = min(-(-chains[..., 0].size // most), chains.shape[1])
    kept = np.swapaxes(chains[:, every - 1 :: every], 1, 2)
    return kept.reshape(-1, kept.shape[-1]), kept.shape[0] * kept.shape[1]
