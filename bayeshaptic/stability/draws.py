"""Which parameter vectors a limit is computed for."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.errors import InputError, shown
from bayeshaptic.models.model import Model
from bayeshaptic.stability.crossings import rational
from bayeshaptic.types import Floats

MOST_DRAWS = 150_000
MOST_SEARCHED = 30_000  # of a loop without a finite set of poles, whose search is slow


def opened(source: Any) -> tuple[Model, Any, Any]:
    """What a caller has, in parts.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed

    Returns
    -------
    model : Model
    holder : Model, or what has `chains`, `draws` or `theta`
    limit : CriticalStiffness or None
        What the caller states for it.

    Raises
    ------
    InputError
        For anything else.
    """
    if isinstance(source, Model):
        return source, source, None
    inner = getattr(source, "analysis", source)  # of a closed loop
    model, holder = getattr(inner, "model", None), getattr(inner, "posterior", inner)
    holds = any(hasattr(holder, name) for name in ("chains", "draws", "theta"))
    if not isinstance(model, Model) or not holds:
        raise InputError(
            f"source is {shown(source)}; give a Model, Fit, Posterior, Case, Analysis or Closed"
        )
    return model, holder, getattr(inner, "limit", None)


def vectors_given(model: Model, theta: ArrayLike) -> Floats:
    """Parameter vectors as a caller gives them, checked; shape (n, P).

    Raises
    ------
    InputError
        For NaN and infinity, another number of parameters than the model has, and a mass that is
        not above zero.
    """
    vectors = np.atleast_2d(np.asarray(theta, float))
    if not vectors.size:
        raise InputError("theta is empty; give one vector of parameters or more")
    if not np.all(np.isfinite(vectors)):
        raise InputError(f"theta is {shown(theta)}; give numbers other than NaN or infinity")
    model.system(vectors[:1])  # which says how many there are
    for column, parameter in enumerate(model.parameters):
        if parameter.dimension == "mass" and not np.all(vectors[:, column] > 0):
            low = vectors[:, column].min()
            raise InputError(f"theta: {parameter.name} is {low:g}; a mass must be above 0")
    return vectors


def draws_of(posterior: Any) -> Floats:
    """The draws of a posterior, (n, P), in the order of the samples of its `critical_stiffness`."""
    return vectors_of(posterior, None, None)[0]


def most_draws(model: Model, vector: Floats) -> int:
    """How many draws `critical_stiffness` looks at, for parameters like `vector`, shape (P,)."""
    return MOST_DRAWS if rational(model.system(vector[None])) else MOST_SEARCHED


def vectors_of(source: Any, theta: ArrayLike | None, max_draws: int | None) -> tuple[Floats, int]:
    """Parameter vectors, chain after chain, and the number of chains.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed
    theta : array_like, shape (n, P) or (P,), or None
        Vectors to take in the place of the source's own.
    max_draws : int or None
        The most to take of a posterior's draws, at equal steps; None: as `most_draws` says.

    Returns
    -------
    vectors : ndarray, shape (n, P)
    chains : int
        Number of chains of equal length; n where the vectors are independent.

    Raises
    ------
    InputError
        As `opened` and `vectors_given` do.
    """
    model, holder, _ = opened(source)
    if theta is not None or isinstance(holder, Model):
        vectors = vectors_given(model, model.values if theta is None else theta)
        return vectors, len(vectors)
    if not hasattr(holder, "chains"):
        vectors = np.atleast_2d(holder.draws if hasattr(holder, "draws") else holder.theta)
        vectors = vectors[:: -(-len(vectors) // (max_draws or len(vectors)))]
        return vectors, len(vectors)
    chains = np.asarray(holder.chains)  # (E, S, W, P)
    most = max_draws or most_draws(model, chains[0, 0, 0])
    every = min(-(-chains[..., 0].size // most), chains.shape[1])
    kept = np.swapaxes(chains[:, every - 1 :: every], 1, 2)
    return kept.reshape(-1, kept.shape[-1]), kept.shape[0] * kept.shape[1]
