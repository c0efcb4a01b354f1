"""Trying internal forces: find the strength and the shape of each law, and what it would mean.

The likelihood of a force is that of the recording less the simulated motion, with the linear
parameters fitted anew: a profile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.state import Accepted, Estimate, State, Trial, describe_gain
from bayeshaptic.diagnosis.trials.force_bench import ForceBench, Point
from bayeshaptic.diagnosis.trials.force_fit import fit_force, spread
from bayeshaptic.effects.laws import variables
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR, Place
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, Motion, NonlinearEffect
from bayeshaptic.inference.fit import Fit, search_box, summarise
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.models.structures import GROUND_DAMPERS
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.random_excitation import points as points_of
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats

_Called = list[NonlinearEffect]  # variants of one effect

_NEAR = np.array([0.8, 1.0])


def nonlinear_trials(
    state: State,
    raised: set[str],
    meter: Meter,
    tick: Callable[[str], None] | None = None,
) -> list[Trial]:
    """One trial for each nonlinear effect that the raised tests call for; the best of its variants.

    Parameters
    ----------
    state : State
    raised : set of str
        Names of the nonlinear tests that are flagged.
    meter : Meter
        Says whether one more search for a force, or one more fit of one, is affordable.
    tick : callable, optional
        Called with the title of each candidate.
    """
    recording = state.etfe.unbroken
    if recording is None:
        return []
    bench = ForceBench(state, recording)
    motion = bench.motions(state.fit.theta, (MOTOR, LOAD, CONNECTION))
    over = variables(raised)
    firsts: dict[str, _Called] = {}  # by the name of the strength: laws of friction share one
    others: list[_Called] = []
    for kind in effects("nonlinear"):
        if _there(kind, state):
            continue
        called = [e for e in kind.candidates(state.model, motion) if e.called_for(over)]
        if called and kind.strength[0] in firsts:
            others.append(called)
        elif called:
            firsts[kind.strength[0]] = called

    def searched(laws: Iterable[_Called], known: dict[str, Point]) -> list[Point]:
        beside = [(law, known.get(law[0].strength[0])) for law in laws]
        there = [(_beside(law, point), point) for law, point in beside]
        return [
            _search(bench, law, motion, tick, point)
            for law, point in there
            if law and meter.affords(law[0].title)
        ]

    found = _fitted(bench, searched(firsts.values(), {}), meter)
    known = {point.effect.strength[0]: point for point in found}
    found = _fitted(bench, searched(others, known), meter, found)
    return [_trial(bench, point) for point in found]


def _there(kind: type[NonlinearEffect], state: State) -> bool:
    """Whether the state has the effect, or another law of the same thing.

    One mass has one friction, and one actuator one characteristic: a second law on top of the
    first would only mend it.
    """
    if any(kind.strength[0] in accepted.estimates for accepted in state.accepted):
        return True
    names = {accepted.name for accepted in state.accepted}
    actuators = {k.name for k in effects("nonlinear") if issubclass(k, CommandEffect)}
    return kind.name in (names | actuators if names & actuators else names)


def _beside(variants: _Called, known: Point | None) -> _Called:
    """Where a force is known by another law, the variants at its place."""
    return [e for e in variants if known is None or e.place == known.effect.place]


def _fitted(
    bench: ForceBench, points: list[Point], meter: Meter, before: Sequence[Point] = ()
) -> list[Point]:
    """The points fitted, the most promising first; the hopeless as they are, the faint left out."""
    found = list(before)
    hopeless = 0.3  # share of the best gain so far below which a scan is not followed up
    faint = 10.0  # gain below which nothing is tried
    for point in sorted(points, key=lambda point: -point.gain_fit):
        if point.gain_fit < faint:
            continue
        best = max((other.gain_fit for other in found), default=0.0)
        worth = point.gain_fit > hopeless * best
        follow = worth and meter.affords(f"{point.effect.title}, its fit")
        found.append(fit_force(bench, point) if follow else point)
    return found


def _search(
    bench: ForceBench,
    variants: _Called,
    motion: dict[Place, Motion],
    tick: Callable[[str], None] | None = None,
    known: Point | None = None,
) -> Point:
    """The best variant on a coarse scan of strengths, or beside that of a known force."""
    if tick:
        tick(variants[0].title)
    theta = bench.state.fit.theta
    points: list[Point] = []
    for effect in variants:
        if known:
            beside = _scan(bench, effect, _NEAR * known.strength, known.theta)
            if not any(np.isfinite(point.gain_fit) for point in beside):
                beside = _scan(bench, effect, _NEAR * known.strength, _damped(bench, known.theta))
            points += beside
            continue
        firsts = effect.first_strengths(bench.model, theta, motion[effect.place])
        for strengths in (firsts, -firsts) if effect.signed else (firsts,):
            points += _scan(bench, effect, strengths, theta, beyond=8)
    return max(points, key=lambda point: point.gain_fit)


def _damped(bench: ForceBench, theta: Floats) -> Floats:
    """Linear parameters beside a force that may have taken all damping: any other runs away there.

    A fifth of what the ground dampers are without a force.
    """
    share, without = 0.2, bench.state.fit.theta
    ground = np.isin(bench.model.names, GROUND_DAMPERS)
    return np.where(ground, np.maximum(theta, share * without), theta)


def _scan(
    bench: ForceBench, effect: NonlinearEffect, strengths: Floats, theta: Floats, beyond: int = 0
) -> list[Point]:
    """From faint to strong, until it is clearly too strong.

    Where the strongest is still the best, up to `beyond` more, each three times the last: friction
    that the linear model took for a damper leaves a motion from which it looks faint.
    """
    points: list[Point] = []
    too_strong = 10.0  # drop of the log likelihood at which a scan stops
    further = strengths[-1] * 3.0 ** np.arange(1, beyond + 1)
    for number, strength in enumerate([*strengths, *further]):
        start = points[-1].theta if points else theta
        points.append(bench.point(effect, float(strength), start))
        gained = points[-1].gain_fit - points[-2].gain_fit if len(points) > 1 else np.inf
        if gained < -too_strong or (number >= len(strengths) - 1 and not gained > 0):
            break
    rising = abs(strengths[-1]) > abs(strengths[0])  # the less an actuator's limit, the stronger
    return points + (_fainter(bench, effect, points[0], theta, beyond) if rising else [])


def _fainter(
    bench: ForceBench, effect: NonlinearEffect, first: Point, theta: Floats, most: int
) -> list[Point]:
    """Where the faintest of a scan is too strong already: ever fainter, until less is no better.

    Tests see forces that are a hundredth of what a scan begins with.
    """
    points = [first]
    no_trace = 1.0  # of the log likelihood
    while first.gain_fit < 0 and len(points) <= most:
        points.append(bench.point(effect, points[-1].strength / 3.0, theta))
        gained = points[-1].gain_fit - points[-2].gain_fit
        if not gained > 0 or abs(points[-1].gain_fit) < no_trace:
            break
    return points[1:]


def _trial(bench: ForceBench, point: Point) -> Trial:
    """What a force would mean."""
    theta = polish(bench.model, point.windows, point.theta)
    fit = summarise(bench.model, point.windows, theta)
    accepted = _accepted(bench, point, *_spread(bench, point))
    state = State(_with_points(point.etfe, fit), fit, (*bench.state.accepted, accepted))
    size = 1 + len(point.effect.shape)
    return Trial(accepted, state, point.gain_fit, point.gain_choose, size)


def _spread(bench: ForceBench, point: Point) -> tuple[float, float]:
    """Standard deviations of the strength, and of log K_CR because of strength and shape."""
    covariance, along = spread(bench, point)
    # Neither the law nor its shape is known better than this.
    law_sd = 0.03  # relative; how well a law and its shape are known at best
    covariance[0, 0] += law_sd**2
    here, low, high = search_box(bench.model)
    step = 1e-3
    sides = here.coordinate(point.theta[None]) + step * np.concatenate([along.T, -along.T])
    limits = critical_stiffness(bench.model, here.natural(np.clip(sides, low, high))).samples
    more, less = np.log(np.maximum(limits, 1e-9)).reshape(2, -1)
    slope = (more - less) / (2 * step)
    relative = min(float(np.sqrt(covariance[0, 0])), 0.5)
    return relative * abs(point.strength), min(float(np.sqrt(slope @ covariance @ slope)), 1.0)


def _accepted(bench: ForceBench, point: Point, sd: float, limit_log_sd: float) -> Accepted:
    model, effect = bench.model, point.effect
    units = (model.force_unit, model.position_unit)
    name, dimension = effect.strength
    estimates: dict[str, Estimate] = {
        name: Estimate(point.strength, sd, unit_of(dimension, *units))
    }
    for key, value in effect.shape.items():
        estimates[key] = Estimate(value, float("nan"), unit_of(effect.dimensions[key], *units))
    return Accepted(
        effect.name,
        effect.title + _where(effect),
        effect.family,
        describe_gain(point.gain_choose),
        estimates,
        ties=effect.ties,
        told_apart_by=effect.told_apart_by,
        limit_log_sd=limit_log_sd,
    )


def _with_points(etfe: Etfe, fit: Fit) -> Etfe:
    """With what a person sees of it made from its own spectra."""
    found = points_of(etfe.spectra.windows(fit.response))
    return replace(
        etfe,
        frequency_hz=found.frequency_hz,
        value=found.value,
        variance=found.variance,
        coherence=found.coherence,
    )


def _where(effect: NonlinearEffect) -> str:
    if isinstance(effect, CommandEffect):
        return ""
    where = {CONNECTION: " in the connection", LOAD: " at the load"}.get(
        effect.place, " at the motor"
    )
    return "" if effect.title.endswith(where) else where
