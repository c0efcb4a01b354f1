"""Closing the loop on a periodic recording: what repeats from period to period is not noise.

The residual of a steady periodic motion repeats whatever causes it, so that other periods prove
nothing.  Candidates, linear effects and internal forces alike, are fitted together with all that
was accepted before to half of the excited lines, and judged on a quarter in between.  The error of
what is not explained counts as noise of unknown size: gains are logarithms of its ratio.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.periodic.forces import force_candidates
from bayeshaptic.diagnosis.periodic.harmonic_balance import Balanced, Basis, balance, promise
from bayeshaptic.diagnosis.periodic.steady_motion import Period, one_period, with_floor
from bayeshaptic.diagnosis.residuals.residual import (
    Test,
    chi_square_score,
    frequency_tests,
    smooth_columns,
)
from bayeshaptic.diagnosis.state import CHOOSE, FIT, Accepted, Estimate, State, share
from bayeshaptic.diagnosis.trials.linear import linear_candidates
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.inference.least_squares import Fit, polish, refine, summarise
from bayeshaptic.inference.screening import promising_starts
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Tick

ROUNDS = 6
FLOOR = 0.002
"""No line is trusted to better than this share of its response while candidates are weighed."""
_ENOUGH = 8.0
_PROMISE = 2.0  # to first order, on the lines to fit: forces that offer less are not tried,
_NEAR = 0.25  # nor those that offer so much less than the best one
_SHARE = 0.15  # of the gain on the lines that were fitted
_THRESHOLD = 5.0


@dataclass(frozen=True)
class Attempt:
    """A candidate, fitted together with all that was accepted before it.

    Attributes
    ----------
    name, title, family : str
    addition : LinearEffect or Basis
    balanced : Balanced
        Fitted to the lines to fit.
    gain_fit, gain_choose : float
        Gain in log likelihood where the size of the noise is unknown.
    size : int
    """

    name: str
    title: str
    family: str
    addition: Any
    balanced: Balanced
    gain_fit: float
    gain_choose: float
    size: int

    @property
    def score(self) -> float:
        return self.gain_choose - 2.0 * self.size

    @property
    def convincing(self) -> bool:
        return self.gain_choose > _ENOUGH and self.gain_choose > _SHARE * self.gain_fit


@dataclass(frozen=True)
class PeriodicLoop:
    """What closing the loop on a periodic recording found.

    Attributes
    ----------
    state : State
        Measurement without what internal forces add, model with linear effects, fit.
    balanced : Balanced
        Model and internal forces fitted to all lines.
    base : Balanced
        The base model, the same way.
    history : tuple of tuple of Attempt
        A round each, best score first.
    chosen : tuple of Attempt
    before, after : tuple of Test
    """

    state: State
    balanced: Balanced
    base: Balanced
    history: tuple[tuple[Attempt, ...], ...]
    chosen: tuple[Attempt, ...]
    before: tuple[Test, ...]
    after: tuple[Test, ...]


def is_periodic(etfe: Etfe) -> bool:
    """Whether this module's loop applies."""
    return isinstance(etfe.spectra, PeriodicSpectra) and etfe.recording is not None


def close_periodic(
    etfe: Etfe, fit: Fit, tick: Tick | None = None, floor: float = FLOOR
) -> PeriodicLoop:
    """Find what a model of a periodic recording lacks.

    Parameters
    ----------
    etfe : Etfe
        Periodic, with its recording.
    fit : Fit
        Of the base model.
    tick : callable, optional
        Called with what is being tried.
    floor : float
        Least noise of a line, as a share of its response.

    Returns
    -------
    PeriodicLoop
    """
    windows, period = compress(with_floor(etfe, floor)), one_period(etfe)
    fitted = share(windows, FIT)
    before = after = periodic_tests(fit)
    part = balance(fit.model, windows, period, (), fit.theta, fitted=fitted)
    base = whole = balance(fit.model, windows, period, (), fit.theta)
    state = State(etfe, fit)
    history: list[tuple[Attempt, ...]] = []
    chosen: list[Attempt] = []
    while len(chosen) < ROUNDS and any(test.flagged for test in after):
        attempts = _attempts(etfe, windows, period, part, tick)
        history.append(attempts)
        best = next((a for a in attempts if a.convincing), None)
        if best is None:
            break
        chosen.append(best)
        part = best.balanced
        whole = balance(part.model, windows, period, part.forces, part.theta, part.strength)
        state = _state(etfe, whole, tuple(chosen))
        after = periodic_tests(state.fit)
    return PeriodicLoop(state, whole, base, tuple(history), tuple(chosen), before, after)


def periodic_tests(fit: Fit) -> tuple[Test, ...]:
    """The tests over frequency, and one of what changes from line to line.

    No linear dynamics do that outside narrow resonances; harmonics that beat with each other do.
    """
    columns, residual, _ = smooth_columns(fit)
    rest = float(residual @ residual - np.sum((columns.T @ residual) ** 2))
    freedom = len(residual) - columns.shape[1] - fit.model.size
    score = chi_square_score(rest, max(freedom, 1))
    text = (
        f"what changes from line to line, as no smooth response does, is {score:.1f} standard "
        "deviations above noise, and repeats from period to period"
    )
    jagged = Test("line to line", "nonlinear", score, _THRESHOLD, None, text)
    return (*frequency_tests(fit), jagged)


def _attempts(
    etfe: Etfe, windows: Windows, period: Period, part: Balanced, tick: Tick | None
) -> tuple[Attempt, ...]:
    """All candidates, the best variant of each, best score first."""
    found: dict[tuple[str, Place | None], Attempt] = {}
    for basis in _promising(windows, period, part):
        if tick:
            tick(basis.title)
        attempt = _with_force(windows, period, part, basis)
        key = (basis.name, basis.place)
        if attempt and (key not in found or attempt.score > found[key].score):
            found[key] = attempt
    rest = replace(windows, target=windows.target - part.added[:, None])
    for effect in linear_candidates(part.model, etfe):
        if tick and (effect.name, None) not in found:
            tick(effect.title)
        attempt = _with_linear(etfe, windows, rest, period, part, effect)
        own = (effect.name, None)
        if own not in found or attempt.score > found[own].score:
            found[own] = attempt
    return tuple(sorted(found.values(), key=lambda attempt: -attempt.score))


def _promising(windows: Windows, period: Period, part: Balanced) -> list[Basis]:
    """Forces that are not there yet and are worth a balance."""
    there = {(basis.name, basis.place) for basis in part.forces}
    offers = [
        (promise(part, windows, period, basis, share(windows, FIT)), basis)
        for variants in force_candidates(part.model, part.motions).values()
        for basis in variants
        if (basis.name, basis.place) not in there
    ]
    least = max([_PROMISE, *(_NEAR * offer for offer, _ in offers)])
    return [basis for offer, basis in offers if offer >= least]


def _with_force(windows: Windows, period: Period, part: Balanced, basis: Basis) -> Attempt | None:
    fitted = share(windows, FIT)
    forces, strength = (*part.forces, basis), np.append(part.strength, 0.0)
    tried = balance(part.model, windows, period, forces, part.theta, strength, fitted)
    if not tried.converged or (basis.positive and tried.strength[-1] < 0):
        return None
    return _judged(basis, basis.title, "nonlinear", 1, part, tried, windows)


def _with_linear(
    etfe: Etfe,
    windows: Windows,
    rest: Windows,
    period: Period,
    part: Balanced,
    effect: LinearEffect,
) -> Attempt:
    fitted = share(windows, FIT)
    model = part.model.with_effect(effect)
    own = effect.starting_values(part.model, etfe)
    inner = rest.part(fitted)
    starts = promising_starts(part.model, effect, inner, part.theta[None], own, keep=4)
    theta, _ = refine(model, inner, starts)
    tried = balance(model, windows, period, part.forces, theta, part.strength, fitted)
    size = len(effect.parameters)
    return _judged(effect, effect.title, "linear", size, part, tried, windows)


def _judged(
    addition: Any,
    title: str,
    family: str,
    size: int,
    part: Balanced,
    tried: Balanced,
    windows: Windows,
) -> Attempt:
    gains = [_gain(part, tried, share(windows, lines)) for lines in (FIT, CHOOSE)]
    return Attempt(addition.name, title, family, addition, tried, gains[0], gains[1], size)


def _gain(before: Balanced, after: Balanced, lines: NDArray[np.bool_]) -> float:
    """Gain in log likelihood, the noise as large as what is left, but not below what it is."""

    def log_spread(balanced: Balanced) -> float:
        return float(np.log(max(balanced.rms(lines), 1.0)))

    return 2.0 * int(np.sum(lines)) * (log_spread(before) - log_spread(after))


def _state(etfe: Etfe, whole: Balanced, chosen: tuple[Attempt, ...]) -> State:
    """What the loop knows: the recording's spectra less the forces' motion, and its fit."""
    spectra = etfe.spectra
    assert isinstance(spectra, PeriodicSpectra)
    own = replace(spectra, position=spectra.position - whole.added)
    # What a person sees, without it too.
    value = etfe.value - whole.added / spectra.force
    corrected = replace(etfe, spectra=own, value=value)
    windows = compress(corrected)
    theta = polish(whole.model, windows, whole.theta)
    accepted = []
    for attempt in chosen:
        accepted.append(_accepted(attempt, whole))
    return State(corrected, summarise(whole.model, windows, theta), tuple(accepted))


def _accepted(attempt: Attempt, whole: Balanced) -> Accepted:
    evidence = (
        "lowers the error on lines it was not fitted to: the log likelihood, with noise as large "
        f"as what is left, rises by {attempt.gain_choose:.0f}"
    )
    if attempt.family == "linear":
        names = tuple(p.name for p in attempt.addition.parameters)
        told = attempt.addition.told_apart_by
        return Accepted(
            attempt.name, attempt.title, "linear", evidence, parameters=names, told_apart_by=told
        )
    index = next(i for i, basis in enumerate(whole.forces) if basis is attempt.addition)
    sd = float(whole.strength_sd[index]) * max(whole.rms(), 1.0)
    estimate = Estimate(float(whole.strength[index]), sd, attempt.addition.unit)
    return Accepted(attempt.name, attempt.title, "nonlinear", evidence, {"strength": estimate})
