"""A population of users: hands differ from person to person, the device hardly."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.coordinates import Coordinates, coordinates
from bayeshaptic.inference.population.below import draw_below
from bayeshaptic.inference.population.gaussian_likelihood import gaussian_likelihood
from bayeshaptic.inference.population.hierarchy import Hierarchy
from bayeshaptic.inference.population.hyperparameters import TRIAL_SPREAD
from bayeshaptic.inference.population.population import Population
from bayeshaptic.inference.population.reweighting import ALONE, Reweighted, redescribed, reweight
from bayeshaptic.inference.population.sampler import LevelChains, sample_level
from bayeshaptic.inference.population.settling import settled_nearby
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import HalfNormal, MaybeZero, Model
from bayeshaptic.models.build import DAMPER_SCALE
from bayeshaptic.models.prior_of_zero import weight_of_zero
from bayeshaptic.models.structures import HAND
from bayeshaptic.progress import silent, told
from bayeshaptic.quantities import percent
from bayeshaptic.shown import listed
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats, Progress

DRAWS = 36_000  # with them 20 lie below the stiffness of 0.1 % risk, in the hands of each user
_FIRST_STEPS = 200  # of chains by which recordings are described
_SOME = 2000  # draws of those that are looked at
_DESCRIPTIONS = 2  # rounds of describing recordings better, at most


@at_the_door
@single_threaded
def infer_population(
    posteriors: Sequence[Posterior],
    users: Sequence[str],
    places: Sequence[float | str | None] | None = None,
    seed: int = 0,
    progress: Progress | bool | None = None,
) -> Population:
    """Infer a population of hands from one posterior a recording.

    The logarithms of a hand's parameters are normal over people, with any mean and covariance; the
    device is the same in all recordings of a configuration, up to a small spread that is inferred;
    a person recorded twice has the same hand, up to a spread between trials.

    Parameters
    ----------
    posteriors : sequence of Posterior
        Of grasped models with the same parameters.
    users : sequence of str
        Who held the device in each.
    places : sequence, optional
        In which configuration each was recorded.
    seed : int
    progress : callable, bool or None
        Called with the share done and a word about it.

    Returns
    -------
    Population

    Raises
    ------
    InputError
        Without recordings, or where their models have different parameters or no hand.

    Notes
    -----
    Each recording's likelihood is described by a Gaussian function (`gaussian_likelihood`) where
    all recordings together say that its parameters are, in two rounds (`settled`), and over draws
    of the exact distribution where that is poor (`redescribed`).  emcee samples the spreads and
    correlations, all else is integrated out (`hierarchy`); in the end each recording's own
    parameters are drawn by its exact likelihood (`reweight`).
    """
    began = time.perf_counter()
    report = told(progress) or silent
    model = common_model(posteriors)
    if not any(name in HAND for name in model.names):
        raise InputError(f"the {model.name} model has no hand: give posteriors of held devices.")
    here = study_coordinates(model, posteriors)
    spike = np.array([weight_of_zero(model.prior(name)) for name in model.names])
    hierarchy, names, spots = _hierarchy(posteriors, users, places or [None] * len(users), here)
    tune, again, run, first, last, rest = np.random.SeedSequence(seed).spawn(6)
    rng = np.random.default_rng(rest)
    report(0.0, "population: first look")
    hierarchy, chains = _settled_twice(hierarchy, posteriors, here, (tune, again), rng)
    report(0.3, "population: describing recordings")
    for own_seed in first.spawn(_DESCRIPTIONS):
        phi = chains.thinned(_SOME, rng)
        better = redescribed(hierarchy, posteriors, users, phi, here, spike, own_seed)
        if better is hierarchy:
            break
        hierarchy = better
        chains = sample_level(hierarchy, again, chains, steps=_FIRST_STEPS)
    report(0.5, "population: sampling")
    chains = sample_level(hierarchy, run, chains)
    report(0.8, "population: users")
    phi, walkers = chains.in_order(DRAWS)
    draws = draw_below(hierarchy, phi, here.low, rng, spike)
    own = reweight(posteriors, users, hierarchy, draws, phi, here, last)
    draws = replace(draws, recordings=draws.recordings[:0])  # many, and no longer needed
    root = draws.level.correlation_root
    return Population(
        parameters=tuple(name for name in model.names if name in HAND),
        log_mean=draws.beta[:, : len(hierarchy.hand)],
        log_sd=draws.level.hand_sd,
        correlation=root @ root.transpose(0, 2, 1),
        users=names,
        places=spots,
        model=model,
        recordings=own,
        notices=(*chains.notices, *_notices(own, names, draws.level.hand_sd)),
        seconds=time.perf_counter() - began,
        chains=chains.resting(),
        walkers=walkers,
        _here=here,
        _hierarchy=hierarchy,
        _below=draws,
    )


def _settled_twice(
    hierarchy: Hierarchy,
    posteriors: Sequence[Posterior],
    here: Coordinates,
    seeds: tuple[np.random.SeedSequence, np.random.SeedSequence],
    rng: np.random.Generator,
) -> tuple[Hierarchy, LevelChains]:
    """Descriptions where all recordings say that parameters are, and short chains by these.

    The first round goes by the scatter of the recordings' own estimates, the second by the chains
    of the first.
    """
    own = hierarchy.likelihoods
    hierarchy = settled_nearby(hierarchy, own, posteriors, here, hierarchy.guess()[0])
    chains = sample_level(hierarchy, seeds[0], steps=_FIRST_STEPS)
    middle = np.median(chains.thinned(_SOME, rng), axis=0)
    hierarchy = settled_nearby(hierarchy, own, posteriors, here, middle)
    return hierarchy, sample_level(hierarchy, seeds[1], chains, steps=_FIRST_STEPS)


def study_coordinates(model: Model, posteriors: Sequence[Posterior] = ()) -> Coordinates:
    """Coordinates that recordings share: hands always as logarithms, the others by their priors.

    The spread of a device between recordings is a share of its parameters.  Of a parameter that is
    not sampled as a logarithm it is in units of its prior's width.  The prior of dampers that may
    be zero is too wide for that, so that their unit is the one of a device whose file gives them
    together: the median over `posteriors` of their sum.

    Parameters
    ----------
    model : Model
        P parameters.
    posteriors : sequence of Posterior
        One a recording; without any, units come from the priors alone.

    Returns
    -------
    Coordinates
        As many as parameters: D = P.
    """
    small = [name for name in model.names if isinstance(model.prior(name), MaybeZero)]
    if small and posteriors:
        columns = [model.names.index(name) for name in small]
        whole = np.median([np.median(one.draws[:, columns].sum(axis=1)) for one in posteriors])
        model = model.with_prior(dict.fromkeys(small, HalfNormal(DAMPER_SCALE * float(whole))))
    here = coordinates(model)
    hand = np.isin(model.names, HAND)
    low = np.where(hand, -np.inf, here.low)
    scale = np.where(hand, 1.0, here.scale)
    return replace(here, log=here.log | hand, scale=scale, low=low)


def prior_moments(model: Model, here: Coordinates) -> tuple[Floats, Floats]:
    """Middle and width of the priors, as if each was normal in the coordinates of the study.

    Of a damper that may be zero the wall is the middle: its half-normal is one half of a normal.
    So it is for one of which a single recording believes that it is near zero.

    Parameters
    ----------
    model : Model
    here : Coordinates

    Returns
    -------
    mean, sd : ndarray, shape (D,)
    """
    priors = [model.prior(name) for name in model.names]
    low, middle, high = (
        here.coordinate(np.array([float(prior.quantile(p)) for prior in priors])[None])[0]
        for p in (0.16, 0.5, 0.84)
    )
    scales = np.array([getattr(prior, "scale", np.nan) for prior in priors]) / here.scale
    half = np.isfinite(scales) & ~here.log
    mean = np.where(half, 0.0, middle)
    sd = np.where(half, scales, 0.5 * (high - low))
    return mean, np.where(here.log, np.minimum(sd, high - middle), sd)


def common_model(posteriors: Sequence[Posterior]) -> Model:
    """The model that all recordings were fitted with.

    Raises
    ------
    InputError
        Without a recording, and where the parameters of two recordings have different names.
    """
    if not posteriors:
        raise InputError("no recording: a study's levels need at least one.")
    model = posteriors[0].model
    for number, posterior in enumerate(posteriors):
        if posterior.names != model.names:
            raise InputError(
                f"posterior {number + 1} has the parameters {', '.join(posterior.names)}, but the "
                f"first has {', '.join(model.names)}: the same model, with the same effects, is "
                "needed in all recordings."
            )
    return model


def _hierarchy(
    posteriors: Sequence[Posterior],
    users: Sequence[str],
    places: Sequence[float | str | None],
    here: Coordinates,
) -> tuple[Hierarchy, tuple[str, ...], tuple[float | str | None, ...]]:
    """The levels with their first description; users and configurations as they first come.

    Raises
    ------
    InputError
        Where there are more or fewer users or configurations than posteriors.
    """
    if not len(users) == len(places) == len(posteriors):
        raise InputError(
            f"{len(posteriors)} posteriors, but {len(users)} users and {len(places)} "
            "configurations: give one of each for every posterior."
        )
    names, spots = tuple(dict.fromkeys(users)), tuple(dict.fromkeys(places))
    model = posteriors[0].model
    is_hand = np.isin(model.names, HAND)
    mean, sd = prior_moments(model, here)
    hierarchy = Hierarchy(
        tuple(gaussian_likelihood(one, here) for one in posteriors),
        np.array([names.index(user) for user in users]),
        np.array([spots.index(place) for place in places]),
        np.flatnonzero(is_hand),
        np.flatnonzero(~is_hand),
        mean,
        sd,
    )
    return hierarchy, names, spots


def _notices(
    recordings: Sequence[Reweighted], users: tuple[str, ...], hand_sd: Floats
) -> tuple[Notice, ...]:
    notices = []
    alone = [one for one in recordings if one.how == ALONE]
    if alone:
        names = ", ".join(dict.fromkeys(one.user for one in alone))
        text = (
            f"{len(alone)} of {len(recordings)} recordings (of {names}) could not be joined with "
            "the others: their parameters given all people could not be sampled. They are shown "
            "by themselves, and the population knows them only roughly."
        )
        notices.append(Notice("warning", "population", text))
    if len(users) < 4:
        says = "user says" if len(users) == 1 else "users say"
        text = (
            f"{len(users)} {says} little about how much people differ: the prior decides, and the "
            "interval of a new person is wide; record at least six people."
        )
        notices.append(Notice("warning", "population", text))
    most = float(np.max(np.median(hand_sd, axis=0)))
    if len(users) > 1 and most < TRIAL_SPREAD:
        text = (
            f"The hands of these {len(users)} people differ by {percent(most)} at most (standard "
            "deviation), less than that of one person does from one recording to the next: are "
            f"{listed(users)} one person? Then give all of its recordings one name; a person not "
            "yet seen is taken to be as like them as they are like one another."
        )
        notices.append(Notice("warning", "population", text))
    return tuple(notices)
