"""Sampling the posterior with emcee, until it has converged."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.inference.coordinates import reach, sampling_coordinates
from bayeshaptic.inference.fit import REACH_SDS, Fit, weighted_residuals
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.ensembles import (
    ENSEMBLES,
    WALKERS,
    Ensembles,
    LogDensity,
    refitted,
    warmed_up,
)
from bayeshaptic.inference.sampling.importance import adapt
from bayeshaptic.inference.sampling.laplace import laplace
from bayeshaptic.inference.sampling.near_zero import redrawing, start_of, with_near_zero
from bayeshaptic.inference.stopping import EveryParameter, Rule, Verdict
from bayeshaptic.models import Model
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats, Progress

DEFAULT_ESS = 2000
MOST_EVALUATIONS = 1_500_000
_FIRST_STEPS = 32
_MARGIN = 1.1  # a forecast of the steps that are needed, and a little further
_LEAST_GROWTH, _MOST_GROWTH = 1.3, 2.0
_MIXED = 0.06  # effective draws a draw, an autocorrelation of 16 steps: below, a proposal is refit
_REFITS = 4
_POLISH, _SETTLED = 200, 1e-3  # steps of the fit, at most, and the gain that is none


@dataclass
class _Counted:
    """A density that counts how often it is evaluated."""

    density: LogDensity
    count: int = 0

    def __call__(self, phi: Floats) -> Floats:
        self.count += len(np.atleast_2d(phi))
        return self.density(phi)


@at_the_door
@single_threaded
def sample(
    model: Model,
    etfe: Etfe,
    start: Fit | None = None,
    ess: float = DEFAULT_ESS,
    seed: int = 0,
    progress: Progress | None = None,
    most_evaluations: int = MOST_EVALUATIONS,
    rule: Rule | None = None,
) -> Posterior:
    """Draw from the posterior of `model`'s parameters given `etfe`.

    A Student t proposal is fitted to the peak, adapted by importance sampling and by a warm-up,
    and frozen; four independent emcee ensembles of 64 walkers then run until R-hat between
    ensembles is below 1.01 and every parameter has `ess` effective draws, bulk and tail.  They are
    looked at where they have grown by up to twice.

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
    most_evaluations : int
        Evaluations of the likelihood after which to give up, a cap that is the same on every
        machine; the result then says it has not converged.
    rule : callable, optional
        What to ask for instead of `ess`: judges chains of natural values, shape (ensembles, S,
        walkers, P), and returns a `bayeshaptic.inference.stopping.Verdict`.

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
    asked = rule or EveryParameter(fit.model, ess)
    report(0.02, "finding the peak")
    fit = _converged(fit)
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    density = Density(fit.likelihood, here)
    seeds = np.random.SeedSequence(seed)
    tune, run, refit = seeds.spawn(3)
    peak, proposal = laplace(density, start_of(here, fit))
    report(0.1, "adapting the proposal")
    counted = _Counted(density)
    adapted = adapt(counted, proposal, np.random.default_rng(tune))
    report(0.2, "warming up")
    ensembles = warmed_up(counted, adapted, run, peak, redrawing(here, fit))
    chains, found, verdict = _run(
        ensembles,
        lambda phi: asked(here.natural(phi)),
        lambda: most_evaluations - counted.count,
        report,
        np.random.default_rng(refit),
    )
    return Posterior(
        fit.model,
        here.natural(chains),
        _log_likelihoods(density, chains, found),
        verdict.diagnostics,
        verdict.done,
        _message(verdict, counted.count),
        time.perf_counter() - began,
        seed,
        fit.windows,
        etfe,
    )


def _converged(fit: Fit) -> Fit:
    """The fit, followed to its optimum along ridges that are straight in sampling coordinates.

    In the logarithms of a fit they are bent, and it may have stopped halfway.
    """
    here = sampling_coordinates(fit.model, fit.theta, fit.sd)
    low, high = (here.coordinate(end) for end in reach(fit.model, REACH_SDS))
    start = here.coordinate(fit.theta[None])
    residuals = weighted_residuals(fit.likelihood, here)
    phi, _ = minimise(residuals, start, low, high, _POLISH, _SETTLED)
    return fit.at(here.natural(phi)[0])


def _run(
    ensembles: Ensembles,
    rule: Rule,
    left: Callable[[], int],
    report: Progress,
    rng: np.random.Generator,
) -> tuple[Floats, Floats, Verdict]:
    """Advance all ensembles until they are done, or no evaluations are `left`.

    Where they mix badly, the proposal is fitted again to the draws at hand, and these are thrown
    away: what is kept comes from one frozen proposal.  Where that does not help, only every so many
    steps are kept: neighbours say the same.
    """
    kept: list[tuple[Floats, Floats]] = []
    steps, more, every, refits = 0, _FIRST_STEPS, 1, 0
    while True:
        report(0.25 + 0.74 * steps / (steps + more), f"step {every * (steps + more)}")
        kept.append(ensembles.advance(more, every))
        chains, values = (np.concatenate(part, axis=1) for part in zip(*kept, strict=True))
        verdict = rule(chains)
        steps = chains.shape[1]
        affordable = left() // (ENSEMBLES * WALKERS * every)
        if verdict.done or affordable < _FIRST_STEPS:
            return chains, values, verdict
        slow = verdict.diagnostics.ess < _MIXED * values.size
        if slow and refits < _REFITS and 2 * every * steps <= affordable * every:
            ensembles = refitted(ensembles, chains, values, rng)
            more, steps, every, refits = 2 * every * steps, 0, 1, refits + 1
            kept.clear()
            continue
        if np.median(verdict.diagnostics.fewest) < _MIXED * values.size and steps > _FIRST_STEPS:
            kept, steps, every = [(chains[:, 1::2], values[:, 1::2])], steps // 2, 2 * every
        growth = _MARGIN / max(verdict.share, 1e-3)
        growth = float(np.clip(growth, _LEAST_GROWTH, _MOST_GROWTH))
        more = max(min(int((growth - 1) * steps), affordable), 1)


def _log_likelihoods(density: Density, chains: Floats, values: Floats) -> Floats:
    """The likelihood's part of the log densities that the chains carry."""
    flat = chains.reshape(-1, chains.shape[-1])
    theta = density.coordinates.natural(flat)
    prior = density.likelihood.model.log_prior(theta) + density.coordinates.log_jacobian(flat)
    return values - prior.reshape(values.shape)


def _message(verdict: Verdict, evaluations: int) -> str:
    if verdict.done:
        return f"Converged because {verdict.facts}."
    return (
        f"Not converged after {evaluations} evaluations of the likelihood: {verdict.facts}, where "
        f"{verdict.asked} were asked for. The interval may be too narrow; more data, a simpler "
        "model or tighter priors help."
    )
