"""Toy recordings with Gaussian likelihoods: a study's levels then have known answers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayeshaptic.inference.diagnostics import Diagnostics
from bayeshaptic.inference.population.infer import study_coordinates
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import build_model
from bayeshaptic.models.model import Model
from bayeshaptic.types import Floats


def toy_model(*names: str, device: str = "phantom", base: str = "grasped") -> Model:
    """A base model in which only `names` are inferred."""
    whole = build_model(base, device)
    known: Mapping[str, float] = {
        name: float(value)
        for name, value in zip(whole.names, whole.values, strict=True)
        if name not in names
    }
    return whole.with_known(known)


def toy_posterior(model: Model, mean: Floats, covariance: Floats, seed: int) -> Posterior:
    """Draws of a recording whose likelihood is Gaussian in the study's coordinates.

    The draws need not be from the posterior: what is used of them is the likelihood that they have.
    """
    rng = np.random.default_rng(seed)
    x = rng.multivariate_normal(mean, covariance, size=800)
    low = study_coordinates(model).low
    x = np.where(x < low, 2 * low - x, x) if np.isfinite(low).any() else x
    off = x - mean
    log_likelihood = -0.5 * np.einsum("bi,ij,bj->b", off, np.linalg.inv(covariance), off)
    chains = study_coordinates(model).natural(x).reshape(2, 20, 20, -1)
    ones = np.ones(model.size)
    return Posterior(
        model,
        chains,
        log_likelihood.reshape(2, 20, 20),
        Diagnostics(ones, 800 * ones, 800 * ones),
        True,
        "made up",
        0.0,
        seed,
    )
