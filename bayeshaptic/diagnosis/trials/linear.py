"""Trying linear effects: fit on half of the windows, judge on a quarter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.state import (
    FIT,
    Accepted,
    State,
    Trial,
    describe_gain,
    log_likelihoods,
    share,
)
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.library import effects
from bayeshaptic.inference.least_squares import polish, refine, summarise
from bayeshaptic.models import Model
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats


def linear_candidates(model: Model, etfe: Etfe) -> list[LinearEffect]:
    """Every variant of every linear effect that makes sense and is not in the model yet."""
    there = {effect.name for effect in model.effects}
    return [
        variant
        for kind in effects("linear")
        if kind.name not in there
        for variant in kind.candidates(model, etfe)
    ]


def linear_trials(state: State, tick: Callable[[str], None] | None = None) -> list[Trial]:
    """One trial for each candidate effect; of an effect's variants the best."""
    base = _base_log_likelihoods(state)
    best: dict[str, Trial] = {}
    for effect in linear_candidates(state.model, state.etfe):
        if tick:
            tick(effect.title)
        trial = _try(state, effect, base)
        if effect.name not in best or trial.score > best[effect.name].score:
            best[effect.name] = trial
    return list(best.values())


def full_fit(state: State, model: Model, theta: Floats) -> State:
    """`model` fitted to all windows from `theta`, compressed around its own fit."""
    for _ in range(2):
        windows = compress(state.etfe, partial(model.response, theta))
        theta = polish(model, windows, theta)
    return replace(state, fit=summarise(model, windows, theta))


def _base_log_likelihoods(state: State) -> tuple[float, float]:
    """Of the model as it is, fitted to its part of the windows alone."""
    theta, windows = _fit_part(state.model, state.etfe, state.fit.windows, state.fit.theta[None])
    return log_likelihoods(state.model, windows, theta)


def _try(state: State, effect: LinearEffect, base: tuple[float, float]) -> Trial:
    model = state.model.with_effect(effect)
    starts, strata = _starts(state, model, effect)
    theta, windows = _fit_part(model, state.etfe, state.fit.windows, starts, strata)
    gains = np.subtract(log_likelihoods(model, windows, theta), base)
    gain_fit, gain_choose = float(gains[0]), float(gains[1])
    accepted = Accepted(
        effect.name,
        effect.title,
        effect.family,
        describe_gain(gain_choose),
        parameters=tuple(p.name for p in effect.parameters),
        told_apart_by=effect.told_apart_by,
    )
    changed = full_fit(state, model, theta) if gain_choose > 8 else state
    changed = replace(changed, accepted=(*state.accepted, accepted))
    return Trial(accepted, changed, gain_fit, gain_choose, len(effect.parameters))


def _starts(state: State, model: Model, effect: LinearEffect) -> tuple[Floats, NDArray[np.int_]]:
    """The effect's own starting values beside the current parameters and the nominal ones.

    From the current ones alone a fit may stay stuck where the base model bent to the data.  Also
    the stratum of each: alike are those with the same parameters and the same first value of the
    effect, which is its frequency if it has one.
    """
    own = effect.starting_values(state.model, state.etfe)
    bases = [state.fit.theta]
    nominal = [state.model.reference.get(name, np.nan) for name in state.model.names]
    if np.isfinite(nominal[: len(state.model.structure.names)]).all():
        bases.append(np.where(np.isfinite(nominal), nominal, state.fit.theta))
    index = [state.model.names.index(n) if n in state.model.names else -1 for n in model.names]
    added = [p.name for p in effect.parameters]
    starts = []
    for base in bases:
        rows = np.empty((len(own), model.size))
        for column, (name, source) in enumerate(zip(model.names, index, strict=True)):
            rows[:, column] = own[:, added.index(name)] if source < 0 else base[source]
        starts.append(rows)
    values, stratum = np.unique(own[:, 0], return_inverse=True)
    strata = [stratum + number * len(values) for number in range(len(bases))]
    return np.concatenate(starts), np.concatenate(strata)


def _fit_part(
    model: Model,
    etfe: Etfe,
    windows: Windows,
    starts: Floats,
    strata: NDArray[np.int_] | None = None,
) -> tuple[Floats, Windows]:
    """Fit the windows to fit by, twice: the second time compressed around the first fit."""
    theta, _ = refine(model, windows.part(share(windows, FIT)), starts, strata)
    windows = compress(etfe, partial(model.response, theta))
    return polish(model, windows.part(share(windows, FIT)), theta), windows
