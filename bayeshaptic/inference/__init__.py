"""Likelihood, least squares, sampling, and the posterior."""

from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.load import load_posterior
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampler import sample

__all__ = ["Fit", "Likelihood", "Posterior", "least_squares", "load_posterior", "sample"]
