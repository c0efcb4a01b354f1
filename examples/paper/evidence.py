"""The evidence of a hypothesis by tempering, in coordinates where the prior is N(0, 1)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from bayeshaptic.types import Floats

LogLikelihood = Callable[[Floats], Floats]

DRAWS = 800
MOVES = 6
RUNS = 2


@dataclass(frozen=True)
class Evidence:
    """The evidence, and draws from the posterior.

    Attributes
    ----------
    log_evidence : float
        Natural logarithm of p(data | hypothesis): of the mean over independent runs.
    sd : float
        Its error, from the spread between the runs.
    draws : ndarray, shape (n, d)
        Posterior draws, in prior standard deviations; each run has its share of the evidence.
    """

    log_evidence: float
    sd: float
    draws: Floats = field(repr=False)


def evidence(
    log_likelihood: LogLikelihood, size: int, seed: int = 0, draws: int = DRAWS, runs: int = RUNS
) -> Evidence:
    """Sequential importance sampling from the prior to the posterior.

    The likelihood is raised to powers that grow from 0 to 1, each step so far that half of the
    draws keep counting.  Its mean weight is one factor of the evidence; then the draws are
    resampled and moved by random-walk Metropolis steps (P. Del Moral, A. Doucet and A. Jasra,
    Journal of the Royal Statistical Society B 68, 2006).

    Parameters
    ----------
    log_likelihood : callable
        Of prior coordinates (n, size) to (n,).
    size : int
    seed, draws, runs : int

    Returns
    -------
    Evidence
    """
    rngs = [np.random.default_rng([seed, run]) for run in range(runs)]
    found = [_run(log_likelihood, size, rng, draws) for rng in rngs]
    logs = np.array([log_evidence for log_evidence, _ in found])
    share = np.exp(logs - logsumexp(logs))
    error = float(np.std(runs * share) / np.sqrt(runs))
    counts = np.round(share * draws).astype(int)
    kept = [z[:count] for (_, z), count in zip(found, counts, strict=True)]
    return Evidence(float(logsumexp(logs) - np.log(runs)), error, np.concatenate(kept))


def _run(
    log_likelihood: LogLikelihood, size: int, rng: np.random.Generator, draws: int
) -> tuple[float, Floats]:
    z = rng.standard_normal((draws, size))
    likelihood = _finite(log_likelihood(z))
    power, total = 0.0, 0.0
    while power < 1.0:
        step = _step(likelihood, 1.0 - power)
        power += step
        log_weight = step * likelihood
        total += float(logsumexp(log_weight) - np.log(draws))
        pick = _resampled(log_weight, rng)
        z, likelihood = z[pick], likelihood[pick]
        z, likelihood = _moved(log_likelihood, power, z, likelihood, rng)
    return total, rng.permutation(z)


def _moved(
    log_likelihood: LogLikelihood,
    power: float,
    z: Floats,
    likelihood: Floats,
    rng: np.random.Generator,
) -> tuple[Floats, Floats]:
    """Metropolis steps that leave prior times likelihood^power as it is."""
    size = z.shape[1]
    root = np.linalg.cholesky(np.cov(z.T) + 1e-9 * np.eye(size))
    scale = 2.38 / np.sqrt(size)
    for _ in range(MOVES):
        proposal = z + scale * rng.standard_normal(z.shape) @ root.T
        proposed = _finite(log_likelihood(proposal))
        gain = power * (proposed - likelihood)
        gain += 0.5 * ((z**2).sum(axis=1) - (proposal**2).sum(axis=1))
        accept = np.log(rng.uniform(size=len(z))) < gain
        z = np.where(accept[:, None], proposal, z)
        likelihood = np.where(accept, proposed, likelihood)
        # A quarter of the steps are to succeed.
        scale *= np.exp(accept.mean() - 0.25)
    return z, likelihood


def _step(likelihood: Floats, most: float) -> float:
    """The largest step of the power, up to `most`, at which half of the draws keep counting."""

    def worth(step: float) -> float:
        weight = np.exp(step * (likelihood - likelihood.max()))
        return float(weight.sum() ** 2 / (weight**2).sum())

    enough = 0.5 * len(likelihood)
    if worth(most) >= enough:
        return most
    low, high = 0.0, most
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if worth(middle) >= enough else (low, middle)
    return high


def _resampled(log_weight: Floats, rng: np.random.Generator) -> NDArray[np.int_]:
    """Systematic resampling."""
    weight = np.exp(log_weight - log_weight.max())
    steps = np.cumsum(weight) / weight.sum()
    places = (np.arange(len(weight)) + rng.uniform()) / len(weight)
    return np.minimum(np.searchsorted(steps, places), len(weight) - 1)


def _finite(log_likelihood: Floats) -> Floats:
    return np.where(np.isfinite(log_likelihood), log_likelihood, -1e6)
