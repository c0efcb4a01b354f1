"""ArviZ's statistics of chains, alike in versions 0.x and 1.x."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from bayeshaptic.types import Floats


def arviz() -> Any:
    """The arviz module, without its once-a-day advertisement of the next version."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FutureWarning)
        import arviz

    return arviz


def effective_sample_size(chains: Floats, method: str) -> float:
    """ArviZ's effective sample size, "bulk" or "tail" (5 % and 95 %), of chains (chain, draw)."""
    keywords = {"prob": (0.05, 0.95)} if method == "tail" else {}
    value = float(arviz().ess(chains, method=method, **keywords))
    return value if np.isfinite(value) else 0.0


def split_rhat(chains: Floats) -> float:
    """ArviZ's rank-normalised split R-hat of chains of shape (chain, draw)."""
    value = float(arviz().rhat(chains))
    return value if np.isfinite(value) else float("inf")
