"""Other laws in the place of those that were found, and two forces in the place of one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis import acceptance
from bayeshaptic.diagnosis.state import Accepted, State, Trial
from bayeshaptic.diagnosis.trials.forces.called_for import called_for
from bayeshaptic.diagnosis.trials.forces.hints import departures
from bayeshaptic.diagnosis.trials.forces.in_pieces import simulated_in
from bayeshaptic.diagnosis.trials.forces.search import beside_others, fitted, search
from bayeshaptic.diagnosis.trials.forces.trial import force_trial
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.diagnosis.trials.taken_off import put_back
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, NonlinearEffect
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares, polish
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.recordings.response.etfe import compress

# How far another force must stand out beside the simple law, over how far the larger law does: then
# it is worth half as much to first order.  Of held devices with friction that falls (four) a drag
# had 0.5, 0.5, 0.5 and 1.0, of those with friction and a drag (two) 1.0 and 1.4.
_AS_FAR = 0.7


def in_the_place_of_one(trials: Sequence[Trial], meter: Meter) -> list[Trial]:
    """Two forces in the place of one whose law contains a simpler one: the simpler, and another.

    Friction that falls with the velocity bends like dry friction with a drag, and a damper makes up
    for the rest: it explained a held device that had both, with 1.8 times its limit.
    """
    found = []
    laws = [(trial, _law(trial)) for trial in trials if trial.convincing]
    for simple, own in laws:
        larger = [law for _, law in laws if law.contains(own)]
        recording = simple.state.etfe.unbroken
        if not (larger and simple.state.model.held) or recording is None:
            continue
        tryout = Tryout(simple.state, recording)
        theta = simple.state.fit.theta
        motion = tryout.simulation.motions(theta, (MOTOR, LOAD, CONNECTION))
        here = tryout.as_it_is(tryout.before, theta, tryout.known_motion)
        least = _AS_FAR * max((h.score for h in departures(tryout, here, larger)), default=np.inf)
        others, _ = called_for(simple.state, {v for law in larger for v in law.over}, motion)
        inner = [law for law in others if not isinstance(law[0], CommandEffect)]
        for point in beside_others(tryout, inner, meter, least):
            trial = force_trial(tryout, point)
            found.append(
                replace(
                    trial,
                    gain_fit=simple.gain_fit + trial.gain_fit,
                    gain_choose=simple.gain_choose + trial.gain_choose,
                    size=simple.size + trial.size,
                )
            )
    return found


def reconsidered(state: State, meter: Meter) -> State:
    """The state with another law in the place of an earlier force, where that predicts more.

    An earlier force was named before the last one was known: a drag may have been taken for cubic
    damping where friction was not known of.  Where several laws do as well, the limit spreads over
    them.  The very same state is returned where none comes near.
    """
    forces = [one for one in state.accepted if one.change and one.change.acting]
    for one in forces[:-1] if simulated_in(state) else ():
        if one in state.accepted:
            state = _likeliest(state, _instead_of(one, state, meter))
    return state


def found_anew(state: State, meter: Meter) -> State:
    """The state with its last force searched for and fitted again; unchanged where there is none.

    A force that was found beside a linear effect which has since been taken out may be larger, act
    at another place, or have another law.
    """
    *rest, last = state.accepted
    if last.change is None or last.change.acting is None:
        return state
    etfe = put_back(state.etfe, last.change, rest)
    bare = State(etfe, least_squares(state.model, etfe, start=state.fit.theta), tuple(rest))
    assert etfe.recording
    tryout = Tryout(bare, etfe.recording)
    if not meter.affords(last.title):
        # As it is; what it leaves open beside an effect that is gone says nothing any more.
        here = tryout.point((*tryout.before, last.change.acting), state.fit.theta)
        return force_trial(tryout, here).state if tryout.stays(here) else state
    motion = tryout.simulation.motions(bare.fit.theta, (MOTOR, LOAD, CONNECTION))
    present = last.change.acting.effect
    own = search(tryout, list(present.candidates(bare.model, motion)), motion, meter)
    laws, _ = called_for(bare, set(present.over), motion)
    others = [law for law in laws if law[0].name != present.name]
    found = [*fitted(tryout, [own], meter), *beside_others(tryout, others, meter)]
    trials = [force_trial(tryout, point) for point in found]
    return max(trials, key=lambda trial: trial.score).state if trials else state


def _instead_of(one: Accepted, state: State, meter: Meter) -> list[Trial]:
    """A force that a state has as a trial, and then others that could be in its place."""
    assert one.change and one.change.acting
    present = one.change.acting.effect
    rest = tuple(accepted for accepted in state.accepted if accepted is not one)
    etfe = put_back(state.etfe, one.change, rest)
    windows = compress(etfe, state.fit.response)
    fit = summarise(state.model, windows, polish(state.model, windows, state.fit.theta))
    without = State(etfe, fit, rest)
    assert etfe.recording
    tryout = Tryout(without, etfe.recording)
    motion = tryout.simulation.motions(fit.theta, (MOTOR, LOAD, CONNECTION))
    laws = [
        [e for e in law if (e.name, e.place) != (present.name, present.place)]
        for law in called_for(without, set(present.over), motion)[0]
    ]
    here = tryout.point((*tryout.before, one.change.acting), state.fit.theta)
    if not tryout.stays(here):
        return []
    others = beside_others(tryout, [law for law in laws if law], meter)
    return [force_trial(tryout, point) for point in (here, *others)]


def _likeliest(state: State, found: list[Trial]) -> State:
    """Of trials, the state's own first, the one that explains most, spread over those near it."""
    if len(found) < 2:
        return state
    most = max(found, key=lambda trial: trial.score)
    near = [trial for trial in found if acceptance.ties(most, trial)]
    best = min(near, key=acceptance.simplicity)
    if len(near) == 1 and best is found[0]:
        return state
    return acceptance.with_ties(best, near)


def _law(trial: Trial) -> NonlinearEffect:
    """The law of the force that is tried."""
    change = trial.accepted.change
    assert change and change.acting
    return change.acting.effect
