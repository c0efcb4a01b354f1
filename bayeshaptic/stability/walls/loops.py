"""Parameter vectors, and the limit they must agree with, from whatever a caller has."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.errors import InputError
from bayeshaptic.models.model import Model
from bayeshaptic.numerics.effective_draws import effective_draws
from bayeshaptic.stability.draws import opened, vectors_given
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Loops:
    """A batch of loops to look at.

    Attributes
    ----------
    model : Model
    draws : ndarray, shape (n, P)
        Equally weighted.
    effective : float
        Effective number of them.
    target : ndarray, shape (n,), or None
        The K_CR that the caller states: of these draws, or its equal quantiles in ascending order.
        None where nothing is stated.
    aligned : bool
        Whether `target` is of these draws.
    """

    model: Model
    draws: Floats
    effective: float
    target: Floats | None
    aligned: bool = False

    @property
    def period_s(self) -> float:
        assert self.model.period_s is not None
        return self.model.period_s


def loops_of(source: Any, theta: ArrayLike | None = None, draws: int = 4000) -> Loops:
    """The loops of a model, a fit, a posterior, a case of a device, or an analysis.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed
    theta : array_like, shape (n, P) or (P,), optional
    draws : int
        About how many of a longer set are kept, at equal steps.

    Raises
    ------
    InputError
        If the source is none of these, or the model has no values or no sampling period.
    """
    model, holder, limit = opened(source)
    if model.period_s is None:
        raise InputError("the model has no sampling period: give period_s, or a device.")
    if theta is not None or isinstance(holder, Model):
        vectors = vectors_given(model, model.values if theta is None else theta)
        return Loops(model, vectors, float(len(vectors)), None)
    if hasattr(holder, "chains"):
        vectors, effective = _thinned_chains(np.asarray(holder.chains), draws)
    elif hasattr(holder, "draws"):
        kept = np.linspace(0, len(holder.draws) - 1, min(draws, len(holder.draws))).astype(int)
        vectors, effective = holder.draws[kept], float(len(kept))
        if limit is not None and len(limit.samples) == len(holder.draws):
            effective = min(effective, limit.effective)
            return Loops(model, vectors, effective, limit.samples[kept], aligned=True)
    else:
        vectors, effective = np.atleast_2d(holder.theta), 1.0
    if limit is None:
        return Loops(model, vectors, effective, None)
    share = (np.arange(len(vectors)) + 0.5) / len(vectors)
    target = np.quantile(limit.samples, share, method="inverted_cdf")
    return Loops(model, vectors, min(effective, limit.effective), target)


def _thinned_chains(chains: Floats, draws: int) -> tuple[Floats, float]:
    """Every so many steps of chains (E, S, W, P), walker after walker; the least effective size."""
    every = min(max(chains[..., 0].size // draws, 1), chains.shape[1])
    kept = np.swapaxes(chains[:, every - 1 :: every], 1, 2)
    walkers = kept.reshape(-1, *kept.shape[2:])
    effective = min(effective_draws(column) for column in np.moveaxis(walkers, 2, 0))
    return walkers.reshape(-1, chains.shape[-1]), effective
