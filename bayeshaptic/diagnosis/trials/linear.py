"""Trying linear effects: fit on half of the windows, judge on a quarter.

All candidates are sieved by a few steps from where first order says that they help most; only those
within reach of the best are fitted in full.
"""

from __future__ import annotations

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
from bayeshaptic.inference.fit import MISFIT, search_box, weighted_residuals
from bayeshaptic.inference.least_squares import Optimum, anew, least_squares, refine
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.screening import promising_starts, starting_bases
from bayeshaptic.models import Model
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats, Tick

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


def linear_trials(state: State, meter: Meter, tick: Tick | None = None) -> list[Trial]:
    """One trial for each candidate effect that is worth it; of an effect's variants the best.

    Parameters
    ----------
    state : State
    meter : Meter
        Says whether one more fit is affordable.
    tick : callable, optional
        Called with the title of each candidate that is fitted in full.
    """
    affords = [meter.affords(one.title) for one in linear_candidates(state.model, state.etfe)]
    if not all(affords):
        return []  # not even sieved
    whole, start = state.fit.windows, state.fit.theta[None]
    first = refine(state.model, whole.part(share(whole, FIT)), start)
    theta, windows = _around(state.model, state.etfe, first)
    base = log_likelihoods(state.model, windows, theta)
    bases = starting_bases(state.model, state.fit.theta, state.fit.elsewhere)
    found = sieve(state.model, state.etfe, windows.part(share(windows, FIT)), bases)
    optima = _followed(state, windows, found, meter, tick)
    best: dict[str, Trial] = {}
    for number, one in enumerate(found):
        trial = _try(state, windows, one, base, optima.get(number))
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
        phi, cost = minimise(residuals, phi, low, high, steps=_STEPS, tolerance=1e-2)
        order = np.argsort(cost)
        # What is left acts as noise of its size.
        left = max(float(cost[order[0]]), float(size))
        gain = size * float(np.log(max(before, size) / left))
        found.append(Sieved(effect, here.natural(phi[order]), gain))
    return sorted(found, key=lambda one: -one.gain)


def _followed(
    state: State, windows: Windows, found: list[Sieved], meter: Meter, tick: Tick | None
) -> dict[int, Optimum]:
    """The candidates within reach of the first fitted in full, by their number.

    From points that no fit has bent only where nothing explains it, and until something does:
    whatever explains it was reached from the present fit, and then no way is barred.
    """
    part = windows.part(share(windows, FIT))
    models = [state.model.with_effect(one.effect) for one in found]
    optima: dict[int, Optimum] = {}
    for number, one in enumerate(found):
        near = one.gain >= thresholds.REACH * found[0].gain
        if near and meter.affords(one.effect.title):
            if tick:
                tick(one.effect.title)
            optima[number] = refine(models[number], part, one.starts)
    for number, optimum in optima.items():
        if any(one.reduced_chi_square <= MISFIT for one in optima.values()):
            break
        if meter.affords(f"{found[number].effect.title}, from other starts"):
            optima[number] = anew(models[number], state.etfe, part, optimum)
    return optima


def _try(state: State, windows: Windows, one: Sieved, base: Floats, first: Optimum | None) -> Trial:
    """The trial of a candidate, followed to an optimum, or as the sieve left it."""
    effect, model = one.effect, state.model.with_effect(one.effect)
    theta = one.starts[0]
    if first is not None:
        theta, windows = _around(model, state.etfe, first)
    gain_fit, gain_choose = (log_likelihoods(model, windows, theta) - base).tolist()
    accepted = Accepted(
        effect.name,
        effect.title,
        effect.family,
        describe_gain(gain_choose),
        parameters=tuple(p.name for p in effect.parameters),
        told_apart_by=effect.told_apart_by,
        change=Change(effect),
    )
    size, changed = len(effect.parameters), state
    if first is not None and thresholds.convincing(gain_fit, gain_choose, size):
        changed = replace(state, fit=least_squares(model, state.etfe, start=theta))
    changed = replace(changed, accepted=(*state.accepted, accepted))
    return Trial(accepted, changed, gain_fit, gain_choose if first is not None else 0.0, size)


def _around(model: Model, etfe: Etfe, first: Optimum) -> tuple[Floats, Windows]:
    """The fit to the windows to fit by once more, compressed around the first one."""
    windows = compress(etfe, partial(model.response, first.theta))
    return fit_part(model, windows, first.theta), windows
