"""Likelihood, least squares, sampling, and the posterior."""

from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampler import sample
from bayeshaptic.inference.saved.load import load_posterior

__all__ = ["Fit", "Likelihood", "Posterior", "least_squares", "load_posterior", "sample"]
