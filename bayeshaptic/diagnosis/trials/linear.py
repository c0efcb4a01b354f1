"""Trying linear effects: fit on half of the windows, judge on a quarter.

All candidates are sieved by a few steps from where first order says that they help most; only those
within reach of the best are fitted in full.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.state import (
    FIT,
    Accepted,
    Change,
    State,
    Trial,
    describe_gain,
    fit_part,
    log_likelihoods,
    share,
)
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.library import effects
from bayeshaptic.inference.fit import search_box, weighted_residuals
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.screening import promising_starts, starting_bases
from bayeshaptic.inference.valleys import CREEPS, Optimum, anew, refine
from bayeshaptic.models import Model
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

_STARTS = 24  # kept by first order,
_STEPS = 15  # and given at most so many steps of Gauss and Newton


@dataclass(frozen=True)
class Sieved:
    """A candidate after a few steps.

    Attributes
    ----------
    effect : LinearEffect
    starts : ndarray, shape (S, P)
        Where the steps have led to, best first.
    gain : float
        In log likelihood on the windows to fit, so far.
    """

    effect: LinearEffect
    starts: Floats
    gain: float


def linear_candidates(model: Model, etfe: Etfe) -> list[LinearEffect]:
    """Every variant of every linear effect that makes sense on the model.

    Those that a device can have several of (`LinearEffect.several`) also where it has one already.
    """
    there = {effect.name for effect in model.effects}
    return [
        variant
        for kind in effects("linear")
        if kind.several or kind.name not in there
        for variant in kind.candidates(model, etfe)
    ]


@dataclass(frozen=True)
class Sight:
    """What linear effects are worth at first sight, from the present fit.

    Attributes
    ----------
    state : State
    windows : Windows
        Compressed around the fit to those to fit.
    base : ndarray, shape (2,)
        Log likelihoods without any: see `log_likelihoods`.
    found : list of Sieved
    optima : mapping
        Those within reach of the first fitted in full, by their number.
    """

    state: State
    windows: Windows
    base: Floats
    found: list[Sieved]
    optima: Mapping[int, Optimum]

    @property
    def explains(self) -> bool:
        """Whether one of them leaves noise, and no mass has run away in it."""
        return any(one.explains for one in self.optima.values())


def first_sight(state: State, meter: Meter) -> Sight | None:
    """All candidates sieved, and the promising ones fitted; None where not even that is affordable.

    Parameters
    ----------
    state : State
    meter : Meter
        Says whether one more fit is affordable.
    """
    affords = [meter.affords(one.title) for one in linear_candidates(state.model, state.etfe)]
    if not all(affords):
        return None
    whole, start = state.fit.windows, state.fit.theta[None]
    first = refine(state.model, whole.part(share(whole, FIT)), start)
    theta, windows = _around(state.model, state.etfe, first)
    base = log_likelihoods(state.model, windows, theta)
    bases = starting_bases(state.model, state.fit.theta, state.fit.elsewhere)
    part = windows.part(share(windows, FIT))
    found = sieve(state.model, state.etfe, part, bases)
    optima: dict[int, Optimum] = {}
    for number, one in enumerate(found):
        near = one.gain >= thresholds.REACH * found[0].gain
        if near and meter.affords(one.effect.title):
            meter.trying(one.effect.title)
            optima[number] = refine(state.model.with_effect(one.effect), part, one.starts)
    return Sight(state, windows, base, found, optima)


def linear_trials(
    state: State,
    meter: Meter,
    sight: Sight | None = None,
    patient: bool = True,
) -> list[Trial]:
    """One trial for each candidate effect that is worth it; of an effect's variants the best.

    Parameters
    ----------
    state : State
    meter : Meter
        Says whether one more fit is affordable.
    sight : Sight, optional
        What was seen of this very state before.
    patient : bool
        Whether to look further than first sight.
    """
    sight = sight or first_sight(state, meter)
    if sight is None:
        return []
    optima = _looked_further(sight, meter) if patient else sight.optima
    best: dict[str, Trial] = {}
    for number, one in enumerate(sight.found):
        trial = _try(state, sight.windows, one, sight.base, optima.get(number))
        name = one.effect.name
        if name not in best or trial.score > best[name].score:
            best[name] = trial
    return list(best.values())


def sieve(model: Model, etfe: Etfe, windows: Windows, bases: Floats) -> list[Sieved]:
    """All candidates after a few steps on the windows, the most promising first.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    windows : Windows
        To fit.
    bases : ndarray, shape (S, P)
        `starting_bases` of the present fit.
    """
    misfits = np.abs(Likelihood(model, windows).normalised(bases)) ** 2
    before = float(np.min(np.sum(misfits, axis=(1, 2))))
    size = windows.target.size
    found = []
    for effect in linear_candidates(model, etfe):
        full = model.with_effect(effect)
        own = effect.starting_values(model, etfe)
        starts = promising_starts(model, effect, windows, bases, own, _STARTS)
        here, low, high = search_box(full)
        residuals = weighted_residuals(Likelihood(full, windows), here)
        phi = np.clip(here.coordinate(starts), low, high)
        phi, cost = minimise(residuals, phi, low, high, _STEPS, 1e-2, CREEPS)
        order = np.argsort(cost)
        # What is left acts as noise of its size.
        left = max(float(cost[order[0]]), float(size))
        gain = size * float(np.log(max(before, size) / left))
        found.append(Sieved(effect, here.natural(phi[order]), gain))
    return sorted(found, key=lambda one: -one.gain)


def _looked_further(sight: Sight, meter: Meter) -> Mapping[int, Optimum]:
    """The optima; where nothing explains the recording, also from points that no fit has bent.

    Where something explains it already, it was reached from the present fit, and no way is barred.
    Few ways lead on from a fit in which a mass has run away to become the ground: there the
    candidates that first sight left aside are followed as well.
    """
    state, part = sight.state, sight.windows.part(share(sight.windows, FIT))
    found, bent = sight, state.fit.run_away
    for number, one in enumerate(sight.found):
        optimum = sight.optima.get(number)
        if found.explains:
            break
        if optimum is None and not bent:
            continue
        if meter.affords(f"{one.effect.title}, from other starts"):
            other = anew(state.model.with_effect(one.effect), state.etfe, part, optimum)
            if other is not None:
                found = replace(found, optima={**found.optima, number: other})
    return found.optima


def accepted_with(effect: LinearEffect, gain_choose: float | None = None) -> Accepted:
    """What an effect would be as a part of the explanation.

    Parameters
    ----------
    effect : LinearEffect
    gain_choose : float, optional
        In log likelihood, on the windows to choose by: the evidence for it.
    """
    return Accepted(
        effect.name,
        effect.title,
        effect.family,
        "" if gain_choose is None else describe_gain(gain_choose),
        parameters=tuple(parameter.name for parameter in effect.parameters),
        told_apart_by=effect.told_apart_by,
        change=Change(effect),
    )


def _try(state: State, windows: Windows, one: Sieved, base: Floats, first: Optimum | None) -> Trial:
    """The trial of a candidate, followed to an optimum, or as the sieve left it."""
    effect, model = one.effect, state.model.with_effect(one.effect)
    theta = one.starts[0]
    if first is not None:
        theta, windows = _around(model, state.etfe, first)
    gain_fit, gain_choose = (log_likelihoods(model, windows, theta) - base).tolist()
    accepted = accepted_with(effect, gain_choose)
    size, changed = len(effect.parameters), state
    if first is not None and thresholds.convincing(gain_fit, gain_choose, size):
        changed = replace(state, fit=least_squares(model, state.etfe, start=theta))
    changed = replace(changed, accepted=(*state.accepted, accepted))
    return Trial(accepted, changed, gain_fit, gain_choose if first is not None else 0.0, size)


def _around(model: Model, etfe: Etfe, first: Optimum) -> tuple[Floats, Windows]:
    """The fit to the windows to fit by, made once more with windows compressed around it."""
    windows = compress(etfe, partial(model.response, first.theta, measured=True))
    return fit_part(model, windows, first.theta), windows
