"""Draws around a fit, for where nothing is to be sampled because nothing will be stated."""

from __future__ import annotations

import numpy as np

from bayeshaptic.inference.diagnostics import diagnose
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.posterior import Posterior

_SHAPE = (4, 16, 64)  # ensembles, steps, walkers


def draws_around(fit: Fit, seed: int = 0) -> Posterior:
    """Normal draws with the covariance of a fit, where the priors expect any; no posterior.

    Parameters
    ----------
    fit : Fit
    seed : int
    """
    rng = np.random.default_rng(seed)
    spread, axes = np.linalg.eigh(np.nan_to_num(fit.covariance))
    root = axes * np.sqrt(np.maximum(spread, 0.0))
    draws = fit.theta + rng.standard_normal((*_SHAPE, len(fit.theta))) @ root.T
    # A fit that knows nothing of a delay may have one of hours within its standard deviations.
    rare = 1e-6
    ends = np.array([fit.model.prior(name).quantile([rare, 1 - rare]) for name in fit.model.names])
    low, high = np.minimum(ends[:, 0], fit.theta), np.maximum(ends[:, 1], fit.theta)
    inside = np.where((draws >= low) & (draws <= high), draws, fit.theta)
    message = "not sampled: nothing that depends on it is stated"
    flat = np.zeros(_SHAPE)
    return Posterior(fit.model, inside, flat, diagnose(inside), True, message, 0.0, seed)
