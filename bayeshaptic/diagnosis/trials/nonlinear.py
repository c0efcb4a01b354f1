"""Trying internal forces: find the strength and the shape of each law, and what it would mean.

The likelihood of a force is that of the recording less the simulated motion, with the linear
parameters fitted anew: a profile.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.state import Accepted, Estimate, State, Trial, describe_gain
from bayeshaptic.diagnosis.trials.forces.bench import ForceBench, Point
from bayeshaptic.diagnosis.trials.forces.in_doubt import in_doubt
from bayeshaptic.diagnosis.trials.forces.search import (
    Variants,
    beside_others,
    containing,
    fitted,
    search,
    to_scan,
    worth_following,
)
from bayeshaptic.diagnosis.trials.taken_off import with_forces
from bayeshaptic.effects.laws import variables
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR, Place
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, Motion, NonlinearEffect
from bayeshaptic.inference.fit import Fit, summarise
from bayeshaptic.inference.least_squares import least_squares, polish
from bayeshaptic.models import Model
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.estimators.random_excitation import points as points_of
from bayeshaptic.recordings.response.etfe import Etfe, compress


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
    motion = bench.simulation.motions(state.fit.theta, (MOTOR, LOAD, CONNECTION))
    firsts, others = _called_for(state, variables(raised), motion)

    def looked_for(
        laws: Iterable[Variants], known: dict[str, Point], before: Sequence[Point] = ()
    ) -> list[Point]:
        """By a scan, or where forces are there by what a little of each law would do."""
        points, inner = [], []
        for law in laws:
            point = known.get(law[0].strength[0])
            if bench.before and point is None and not isinstance(law[0], CommandEffect):
                inner.append(law)
            elif (there := _beside(law, point)) and meter.affords(law[0].title):
                points.append(search(bench, there, motion, tick, point))
        found = fitted(bench, points, meter, before)
        return found + beside_others(bench, inner, meter, tick) if inner else found

    # Of a mass that a controller holds against its friction first order says nothing: strengths
    # that gained 195 in log likelihood had a score of zero.
    in_loop = state.etfe.direct or state.etfe.through_reference
    found = looked_for(firsts if in_loop else to_scan(bench, firsts, {}, meter), {})
    known = {point.effect.strength[0]: point for point in found}
    for point in [one for one in known.values() if worth_following(one, known.values())]:
        laws = [_beside(law, point) for law in others if law[0].contains(point.effect)]
        found += containing(bench, point, laws, meter, tick)
    rest = [law for law in others if not any(law[0].contains(p.effect) for p in known.values())]
    # Where a limit is gradual says nothing of where it would be hard.
    alike = {name: p for name, p in known.items() if not isinstance(p.effect, CommandEffect)}
    found = looked_for(to_scan(bench, rest, alike, meter), alike, found)
    return [_trial(bench, point) for point in found]


def trial_of(
    kind: type[NonlinearEffect],
    state: State,
    meter: Meter,
    tick: Callable[[str], None] | None = None,
) -> Trial | None:
    """One law of a force beside a state; None where it does not convince, in a scan or fitted.

    Parameters
    ----------
    kind : type of NonlinearEffect
    state : State
    meter : Meter
        Says whether that is affordable.
    tick : callable, optional
        Called with its title.
    """
    if state.etfe.unbroken is None or not meter.affords(kind.title):
        return None
    bench = ForceBench(state, state.etfe.unbroken)
    motion = bench.simulation.motions(state.fit.theta, (MOTOR, LOAD, CONNECTION))
    best = search(bench, list(kind.candidates(state.model, motion)), motion, tick)
    if not thresholds.convincing(best.gain_fit, best.gain_choose, 1):
        return None
    trials = [_trial(bench, point) for point in fitted(bench, [best], meter)]
    return next((trial for trial in trials if trial.convincing), None)


def reconsidered(state: State, meter: Meter, tick: Callable[[str], None] | None = None) -> State:
    """With another law in the place of an earlier force, where that predicts more.

    What an earlier force was found to be was found without the last one: cubic damping for a drag,
    where friction was not known of.  The very same state where nothing is better.
    """
    forces = [one for one in state.accepted if one.change and one.change.acting]
    best, most = state, thresholds.TIE
    for one in forces[:-1] if state.etfe.unbroken else ():
        found = _instead_of(one, state, meter, tick)
        for trial in found[1:]:
            if trial.score - found[0].score > most:
                best, most = trial.state, trial.score - found[0].score
    return best


def found_anew(state: State, meter: Meter, tick: Callable[[str], None] | None = None) -> State:
    """The state with its last force searched for and fitted once more; as it is without one.

    Where it was found beside a linear effect that the state does not have any more it may be at
    another place, and larger, or have another law.
    """
    *rest, last = state.accepted
    if last.change is None or last.change.acting is None or not meter.affords(last.title):
        return state
    etfe = with_forces(state.etfe, (last.change,))
    bare = State(etfe, least_squares(state.model, etfe, start=state.fit.theta), tuple(rest))
    assert etfe.recording
    bench = ForceBench(bare, etfe.recording)
    motion = bench.simulation.motions(bare.fit.theta, (MOTOR, LOAD, CONNECTION))
    present = last.change.acting.effect
    own = search(bench, list(present.candidates(bare.model, motion)), motion, tick)
    laws, _ = _called_for(bare, set(present.over), motion)
    others = [law for law in laws if law[0].name != present.name]
    found = [*fitted(bench, [own], meter), *beside_others(bench, others, meter, tick)]
    trials = [_trial(bench, point) for point in found]
    return max(trials, key=lambda trial: trial.score).state if trials else state


def _instead_of(
    one: Accepted, state: State, meter: Meter, tick: Callable[[str], None] | None
) -> list[Trial]:
    """A force that a state has as a trial, and then others that could be in its place."""
    assert one.change and one.change.acting
    present = one.change.acting.effect
    etfe = with_forces(state.etfe, (one.change,))
    windows = compress(etfe, state.fit.response)
    fit = summarise(state.model, windows, polish(state.model, windows, state.fit.theta))
    rest = tuple(accepted for accepted in state.accepted if accepted is not one)
    without = State(etfe, fit, rest)
    assert etfe.recording
    bench = ForceBench(without, etfe.recording)
    motion = bench.simulation.motions(fit.theta, (MOTOR, LOAD, CONNECTION))
    laws = [
        [e for e in law if (e.name, e.place) != (present.name, present.place)]
        for law in _called_for(without, set(present.over), motion)[0]
    ]
    here = bench.point((*bench.before, one.change.acting), state.fit.theta)
    if not bench.stays(here):
        return []
    others = beside_others(bench, [law for law in laws if law], meter, tick)
    return [_trial(bench, point) for point in (here, *others)]


def _called_for(
    state: State, over: set[str], motion: dict[Place, Motion]
) -> tuple[list[Variants], list[Variants]]:
    """Variants of the effects over variables: the first law of each strength, and other laws."""
    firsts: dict[str, Variants] = {}  # by the name of the strength: laws of friction share one
    others: list[Variants] = []
    for kind in effects("nonlinear"):
        if is_there(kind, state):
            continue
        called = [e for e in kind.candidates(state.model, motion) if e.called_for(over)]
        if called and kind.strength[0] in firsts:
            others.append(called)
        elif called:
            firsts[kind.strength[0]] = called
    return list(firsts.values()), others


def is_there(kind: type[NonlinearEffect], state: State) -> bool:
    """Whether the state has the effect, or another law of the same thing.

    One mass has one friction, and one actuator one characteristic: a second law on top of the
    first would only mend it.
    """
    if any(kind.strength[0] in accepted.estimates for accepted in state.accepted):
        return True
    names = {accepted.name for accepted in state.accepted}
    actuators = {k.name for k in effects("nonlinear") if issubclass(k, CommandEffect)}
    return kind.name in (names | actuators if names & actuators else names)


def _beside(variants: Variants, known: Point | None) -> Variants:
    """Where a force is known by another law, the variants at its place."""
    return [e for e in variants if known is None or e.place == known.effect.place]


def _trial(bench: ForceBench, point: Point) -> Trial:
    """What a force would mean, and those before it beside it."""
    theta = polish(bench.model, point.windows, point.theta)
    fit = summarise(bench.model, point.windows, theta)
    accepted = _accepted(bench, point)
    state = State(_with_points(point.etfe, fit), fit, accepted)
    size = 1 + len(point.effect.shape)
    return Trial(accepted[-1], state, point.gain_fit, point.gain_choose, size)


def _accepted(bench: ForceBench, point: Point) -> tuple[Accepted, ...]:
    """What is accepted with a point: forces before it are what they are beside the new one."""
    (*earlier, own), (*sds, own_sd), limit_log_sd = point.changes, *in_doubt(bench, point)
    effect = point.effect
    new = Accepted(
        effect.name,
        effect.title + _where(effect),
        effect.family,
        describe_gain(point.gain_choose),
        _estimates(bench.model, point.forces[-1], own_sd),
        ties=effect.ties,
        told_apart_by=effect.told_apart_by,
        limit_log_sd=limit_log_sd,
        change=own,
    )
    there = iter(zip(earlier, sds, strict=True))
    found = []
    for one in bench.state.accepted:
        if one.change and one.change.acting:
            change, sd = next(there)
            assert change.acting
            one = replace(
                one,
                estimates=_estimates(bench.model, change.acting, sd),
                change=change,
                # What it leaves open is in the new one's; what another law would make of it is not.
                limit_log_sd=one.limit_log_sd if one.ties else 0.0,
            )
        found.append(one)
    return (*found, new)


def _estimates(model: Model, force: Acting, sd: float) -> dict[str, Estimate]:
    """Strength and shape."""
    effect, units = force.effect, (model.force_unit, model.position_unit)
    name, dimension = effect.strength
    found = {name: Estimate(force.strength, sd, unit_of(dimension, *units))}
    for key, value in effect.shape.items():
        found[key] = Estimate(value, float("nan"), unit_of(effect.dimensions[key], *units))
    return found


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
