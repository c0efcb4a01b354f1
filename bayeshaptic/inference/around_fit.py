"""Draws around a fit, for where nothing is to be sampled because nothing will be stated."""

from __future__ import annotations

import numpy as np

from bayeshaptic.inference.diagnostics import diagnose
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.posterior import Posterior

_SHAPE = (4, 16, 64)  # ensembles, steps, walkers


def draws_around(fit: Fit, seed: int = 0) -> Posterior:
    """Normal draws with the covariance of a fit, inside of the priors' support; no posterior.

    Parameters
    ----------
    fit : Fit
    seed : int
    """
    rng = np.random.default_rng(seed)
    spread, axes = np.linalg.eigh(np.nan_to_num(fit.covariance))
    root = axes * np.sqrt(np.maximum(spread, 0.0))
    draws = fit.theta + rng.standard_normal((*_SHAPE, len(fit.theta))) @ root.T
    support = np.array([fit.model.prior(name).support for name in fit.model.names])
    inside = np.where((draws > support[:, 0]) & (draws < support[:, 1]), draws, fit.theta)
    message = "not sampled: nothing that depends on it is stated"
    flat = np.zeros(_SHAPE)
    return Posterior(fit.model, inside, flat, diagnose(inside), True, message, 0.0, seed)
