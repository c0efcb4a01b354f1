"""Sampling the posterior with emcee, until it has converged."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.inference.coordinates import reach, sampling_coordinates
from bayeshaptic.inference.fit import REACH_SDS, Fit, weighted_residuals
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.ensembles import ENSEMBLES, WALKERS
from bayeshaptic.inference.sampling.near_zero import (
    inside,
    redrawing,
    resolved,
    start_of,
    with_near_zero,
)
from bayeshaptic.inference.sampling.peaks import warmed_up_about_peaks
from bayeshaptic.inference.sampling.run import Run, run_until_done
from bayeshaptic.inference.sampling.settings import MOST_EVALUATIONS, SamplerSettings
from bayeshaptic.inference.sampling.stopping import EveryParameter, Rule, Verdict
from bayeshaptic.inference.saved.checkpoint import Checkpoint, Stored, key_of
from bayeshaptic.models import Model
from bayeshaptic.models.start import informed
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.progress import silent, told
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats, LogDensity, Progress
from bayeshaptic.version import __version__

DEFAULT_ESS = 2000
_WARM_UP = 1 / 3  # of the evaluations: a warm-up of 14 parameters took all that a misfit may cost
# Log density of the best fit over that of the best draw, beside one a parameter, from which on the
# chains have not found it: they agree with each other in a valley that is none. It was -1.2 to 0.4
# in eight posteriors of both devices, free and held, with and without a device file.
LOST = 10.0
_LOST = (
    "Not converged: the chains agree with each other, but none of them comes near the best fit. "
    "Record again, or give a device file or priors of your own."
)


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
    progress: Progress | bool | None = None,
    most_evaluations: int = MOST_EVALUATIONS,
    rule: Rule | None = None,
    checkpoints: str | Path | None = None,
) -> Posterior:
    """Draw from the posterior of `model`'s parameters given `etfe`.

    A Student t proposal is fitted to the peak, adapted by a warm-up, and frozen; four independent
    emcee ensembles of 64 walkers then run until R-hat between ensembles is below 1.01 and every
    parameter has `ess` effective draws, bulk and tail.  They are looked at where they have grown by
    up to four times.
    Where the fit shows other peaks, each has a proposal, and walkers, of its own.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    start : Fit, optional
        A least-squares fit to begin from; made here when absent, and made anew from there where it
        is of other data, or of a model with other priors or known values.
    ess : float
        Effective draws that every parameter must have, in the bulk and in the tails.
    seed : int
        Same seed, same draws.
    progress : callable, bool or None
        Called with the share done and a word about it; True draws a bar.
    most_evaluations : int
        Evaluations of the likelihood after which to give up, a cap that is the same on every
        machine; the result then says it has not converged. Chains that lack less than half of what
        is asked for go on for as many again.
    rule : callable, optional
        What to ask for instead of `ess`: judges chains of natural values, shape (ensembles, S,
        walkers, P), and returns a `bayeshaptic.inference.sampling.stopping.Verdict`.
    checkpoints : path, optional
        Folder in which a sampler that runs for longer than some ten seconds keeps its state: called
        again after an interruption, it goes on, with the same draws to the last digit.

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
    if start is None:
        start = least_squares(model, etfe, seed=seed)
    elif start.etfe is not etfe or start.model != informed(model, etfe):
        start = least_squares(model, etfe, start=start.theta)
    rule = rule or EveryParameter(start.model, ess)
    settings = SamplerSettings(rule, seed, progress, checkpoints, most_evaluations)
    return sample_around(start, etfe, settings)


@single_threaded
def sample_around(fit: Fit, etfe: Etfe, settings: SamplerSettings) -> Posterior:
    """Draw from the posterior of the likelihood and the priors that `fit` has, as they are.

    `sample` is the door to it: it makes the fit, or makes it anew where it is of something else.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        What the posterior is said to be of.
    settings : SamplerSettings
    """
    began = time.perf_counter()
    report = told(settings.progress) or silent
    report(0.02, "finding the peak")
    fit = resolved(_converged(fit))
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    density = Density(fit.likelihood, here)
    counted = _Counted(density)
    run, verdict = _run(fit, density, counted, settings, report)
    best = density(inside(here, fit))[0]
    lost = best - run.values.max() > LOST + len(fit.theta)
    return Posterior(
        fit.model,
        here.natural(run.chains),
        _log_likelihoods(density, run.chains, run.values),
        verdict.diagnostics,
        verdict.known and not lost,
        _LOST if lost else _message(verdict, counted.count),
        time.perf_counter() - began,
        settings.seed,
        fit.windows,
        etfe,
    )


def _run(
    fit: Fit, density: Density, counted: _Counted, settings: SamplerSettings, report: Progress
) -> tuple[Run, Verdict]:
    """Chains until the rule is content or evaluations run out, from a checkpoint if there is one.

    `counted` is the same density, by which evaluations are counted.
    """
    here = density.coordinates
    origin, redraw = start_of(here, fit), redrawing(here, fit)
    checkpoint = _checkpoint(settings, density, origin)

    def restore(arrays: Stored) -> Run:
        run = Run.from_arrays(arrays, counted, redraw)
        counted.count = int(arrays["evaluations"])
        return run

    def keep(run: Run) -> None:
        if checkpoint.due():
            checkpoint.write({**run.to_arrays(), "evaluations": np.array(counted.count)})

    run = checkpoint.read(restore)
    if run is None:
        warm, refit = np.random.SeedSequence(settings.seed).spawn(2)
        report(0.1, "warming up")
        steps = _WARM_UP * settings.most_evaluations / (ENSEMBLES * WALKERS)
        ensembles = warmed_up_about_peaks(counted, density, origin, fit, warm, redraw, steps)
        run = Run(ensembles, np.random.default_rng(refit))
    verdict = run_until_done(
        run,
        lambda phi: settings.rule(here.natural(phi)),
        lambda times: int(times * settings.most_evaluations) - counted.count,
        report,
        keep,
    )
    return run, verdict


def _converged(fit: Fit) -> Fit:
    """The fit, followed to its optimum in sampling coordinates, in which its ridges are straight.

    In the logarithms of a fit ridges are bent, and it may have stopped halfway.
    """
    here = sampling_coordinates(fit.model, fit.theta, fit.sd)
    low, high = (here.coordinate(end) for end in reach(fit.model, REACH_SDS))
    start = here.coordinate(fit.theta[None])
    residuals = weighted_residuals(fit.likelihood, here)
    polish, settled = 200, 1e-3  # steps of the fit, at most, and the gain that is none
    phi, _ = minimise(residuals, start, low, high, polish, settled)
    return fit.at(here.natural(phi)[0])


def _checkpoint(settings: SamplerSettings, density: Density, start: Floats) -> Checkpoint:
    """Where a sampler keeps its state, by what it is asked for and the density around its start."""
    folder = settings.checkpoints
    asked = (settings.seed, settings.most_evaluations, getattr(settings.rule, "key", None))
    if folder is None or None in asked:
        return Checkpoint(None, "")
    probe = 0.01  # sampling coordinates, between points whose densities tell computations apart
    places = start + np.concatenate([np.zeros((1, len(start))), probe * np.eye(len(start))])
    theta = density.coordinates.natural(places)
    about = (__version__, np.__version__, density.likelihood.model.names, *asked)
    return Checkpoint(Path(folder), key_of(*about, theta, density(places)))


def _log_likelihoods(density: Density, chains: Floats, values: Floats) -> Floats:
    """The likelihood's part of the log densities that the chains carry."""
    flat = chains.reshape(-1, chains.shape[-1])
    theta = density.coordinates.natural(flat)
    prior = density.likelihood.model.log_prior(theta) + density.coordinates.log_jacobian(flat)
    return values - prior.reshape(values.shape)


def _message(verdict: Verdict, evaluations: int) -> str:
    if verdict.done:
        return f"Converged because {verdict.facts}."
    if verdict.known:
        return (
            f"Converged because {verdict.facts}. Stopped after {evaluations} evaluations of the "
            "likelihood, so that the limit or a small risk may be known less well than asked for."
        )
    return (
        f"Not converged after {evaluations} evaluations of the likelihood: {verdict.facts}, where "
        f"{verdict.asked} were asked for. The interval may be too narrow; more data, a simpler "
        "model or tighter priors help."
    )
