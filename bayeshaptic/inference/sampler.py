"""Sampling the posterior with emcee, until it has converged."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.coordinates import sampling_coordinates
from bayeshaptic.inference.diagnostics import RHAT_LIMIT, Diagnostics, diagnose
from bayeshaptic.inference.least_squares import Fit, least_squares
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.ensembles import Ensemble, refitted, warmed_up
from bayeshaptic.inference.sampling.importance import adapt
from bayeshaptic.inference.sampling.laplace import laplace
from bayeshaptic.inference.sampling.near_zero import redrawing, start_of, with_near_zero
from bayeshaptic.models import Model
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats, Progress

Until = Callable[[Floats], int]
"""Called with the chains (ensembles, S, walkers, P): how many steps they should have in all."""

DEFAULT_ESS = 2000
_FIRST_STEPS = 100
_PATIENCE = 2.0  # a run that must still grow by this factor is better begun again,
_MIXED = 0.06  # unless it has this many effective draws a draw: an autocorrelation of 16 steps
_REFITS = 4
_MOST_STEPS = 6000


@single_threaded
def sample(
    model: Model,
    etfe: Etfe,
    start: Fit | None = None,
    ess: float = DEFAULT_ESS,
    seed: int = 0,
    progress: Progress | None = None,
    most_steps: int = _MOST_STEPS,
    until: Until | None = None,
) -> Posterior:
    """Draw from the posterior of `model`'s parameters given `etfe`.

    A Student t proposal is fitted to the peak, adapted by importance sampling and by a warm-up,
    and frozen; four independent emcee ensembles of 64 walkers then run until R-hat between
    ensembles is below 1.01 and every parameter has `ess` effective draws, bulk and tail.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    start : Fit, optional
        A least-squares fit to begin from; made here when absent.
    ess : float
        Effective draws that every parameter must have, in the bulk and in the tails.
    seed : int
        Same seed, same draws.
    progress : callable, optional
        Called with the share done and a word about it.
    most_steps : int
        Steps of an ensemble after which to give up; the result then says it has not converged.
    until : callable, optional
        Called with the converged chains, shape (ensembles, S, walkers, P): how many steps they
        should have in all.  For what needs more draws than the parameters do.

    Returns
    -------
    Posterior

    Raises
    ------
    InputError
        If `start` is a fit of another model, or `ess` is not positive.
    """
    if ess <= 0:
        raise InputError(f"ess is {ess}; give a positive number of effective draws.")
    if start is not None and start.model.names != model.names:
        raise InputError(
            f"start is a fit of {', '.join(start.model.names)}, but the model has "
            f"{', '.join(model.names)}: fit this model first."
        )
    began = time.perf_counter()
    report = progress or (lambda share, word: None)
    fit = start if start is not None else least_squares(model, etfe, seed=seed)
    report(0.02, "finding the peak")
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    density = Density(fit.likelihood, here)
    seeds = np.random.SeedSequence(seed)
    tune, run, refit = seeds.spawn(3)
    peak, proposal = laplace(density, start_of(here, fit))
    report(0.1, "adapting the proposal")
    adapted = adapt(density, proposal, np.random.default_rng(tune))
    report(0.2, "warming up")
    ensembles = warmed_up(density, adapted, run, peak, redrawing(here, fit))
    more = until or (lambda natural: natural.shape[1])
    chains, found = _run(
        ensembles,
        ess,
        most_steps,
        lambda phi: more(here.natural(phi)),
        report,
        np.random.default_rng(refit),
    )
    natural = here.natural(chains)
    log_likelihood = _log_likelihoods(density, chains, found)
    diagnostics = diagnose(natural)
    converged = _is_done(diagnostics, ess)
    return Posterior(
        fit.model,
        natural,
        log_likelihood,
        diagnostics,
        converged,
        _message(fit.model, diagnostics, ess, converged, chains.shape[1]),
        time.perf_counter() - began,
        seed,
        fit.windows,
        etfe,
    )


def _run(
    ensembles: list[Ensemble],
    ess: float,
    most_steps: int,
    until: Until,
    report: Progress,
    rng: np.random.Generator,
) -> tuple[Floats, Floats]:
    """Advance all ensembles side by side until they are done, forecasting how far to go.

    Where that is far, the proposal is fitted again to the draws at hand, and these are thrown
    away: what is kept comes from one frozen proposal.
    """
    chains: list[Floats] = []
    densities: list[Floats] = []
    gone, steps, more, refits = 0, 0, min(_FIRST_STEPS, most_steps), 0
    while True:
        advanced = []
        for index, ensemble in enumerate(ensembles):
            advanced.append(ensemble.advance(more))
            share = 0.25 + 0.75 * (steps + more * (index + 1) / len(ensembles)) / (steps + more)
            report(min(share, 0.99), f"step {gone + more}")
        chains.append(np.stack([chain for chain, _ in advanced]))
        densities.append(np.stack([values for _, values in advanced]))
        gone, steps = gone + more, steps + more
        joined = np.concatenate(chains, axis=1)
        diagnostics = diagnose(joined)
        done = _is_done(diagnostics, ess)
        if done and gone < most_steps:
            more = min(until(joined) - steps, most_steps - gone)
            if more > 0:
                continue
        if done or gone >= most_steps:
            return joined, np.concatenate(densities, axis=1)
        # Effective draws grow with the steps: go as far as that promises, and a little further.
        wanted = 1.05 * steps * ess / max(diagnostics.ess, 1.0)
        slow = diagnostics.ess < _MIXED * joined[..., 0].size and wanted > _PATIENCE * steps
        again = refits < _REFITS and 4 * more <= most_steps - gone
        if (slow or diagnostics.rhat.max() > RHAT_LIMIT) and again:
            ensembles = refitted(ensembles, joined, np.concatenate(densities, axis=1), rng)
            more, steps, refits = 2 * more, 0, refits + 1
            chains.clear()
            densities.clear()
        else:
            more = int(np.clip(wanted - steps, _FIRST_STEPS, 4 * steps))
        more = min(more, most_steps - gone)


def _is_done(diagnostics: Diagnostics, ess: float) -> bool:
    return bool(diagnostics.ess >= ess and diagnostics.rhat.max() < RHAT_LIMIT)


def _log_likelihoods(density: Density, chains: Floats, values: Floats) -> Floats:
    """The likelihood's part of the log densities that the chains carry."""
    flat = chains.reshape(-1, chains.shape[-1])
    theta = density.coordinates.natural(flat)
    prior = density.likelihood.model.log_prior(theta) + density.coordinates.log_jacobian(flat)
    return values - prior.reshape(values.shape)


def _message(
    model: Model, diagnostics: Diagnostics, ess: float, converged: bool, steps: int
) -> str:
    worst = model.names[int(np.argmax(diagnostics.rhat))]
    fewest = np.minimum(diagnostics.ess_bulk, diagnostics.ess_tail)
    least = model.names[int(np.argmin(fewest))]
    facts = (
        f"R-hat between the independent ensembles is at most {diagnostics.rhat.max():.4f} "
        f"({worst}) and every parameter has at least {fewest.min():.0f} effective draws, "
        f"bulk and tail ({least} has the fewest)"
    )
    if converged:
        return f"Converged because {facts}."
    return (
        f"Not converged after {steps} steps: {facts}, where {RHAT_LIMIT} and {ess:.0f} were asked "
        "for. The interval may be too narrow; more data, a simpler model or tighter priors help."
    )
