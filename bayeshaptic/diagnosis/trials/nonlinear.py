"""Trying internal forces: find the strength and the shape of each law, and what it would mean.

The likelihood of a force is that of the recording less the simulated motion, with the linear
parameters fitted anew: a profile.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.battery import is_periodic
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.diagnosis.trials.forces.called_for import called_for
from bayeshaptic.diagnosis.trials.forces.in_pieces import simulated_in
from bayeshaptic.diagnosis.trials.forces.search import (
    Variants,
    beside_others,
    containing,
    fitted,
    search,
    to_scan,
    worth_following,
)
from bayeshaptic.diagnosis.trials.forces.trial import force_trial
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.diagnosis.trials.other_laws import in_the_place_of_one
from bayeshaptic.diagnosis.trials.other_side import as_seen_from, turned
from bayeshaptic.effects.laws import variables
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, NonlinearEffect
from bayeshaptic.numerics.spending import Meter


def nonlinear_trials(
    state: State,
    raised: set[str],
    meter: Meter,
) -> list[Trial]:
    """One trial for each nonlinear effect that the raised tests call for; the best of its variants.

    Parameters
    ----------
    state : State
    raised : set of str
        Names of the nonlinear tests that are flagged.
    meter : Meter
        Says whether one more search for a force, or one more fit of one, is affordable.
    """
    if simulated_in(state) is None or is_periodic(state.etfe):
        return []  # of what repeats, as a mended recording may, the lines have trials of their own
    found = _of_laws(state, raised, meter)
    other = turned(state)
    if other is None:
        return found
    return found + as_seen_from(state, other, _of_laws(other, raised, meter))


def _of_laws(state: State, raised: set[str], meter: Meter) -> list[Trial]:
    """The trials beside the linear effects of a state as they are."""
    recording = simulated_in(state)
    assert recording is not None
    tryout = Tryout(state, recording)
    motion = tryout.simulation.motions(state.fit.theta, (MOTOR, LOAD, CONNECTION))
    firsts, others = called_for(state, variables(raised), motion)

    def looked_for(
        laws: Iterable[Variants], known: dict[str, Point], before: Sequence[Point] = ()
    ) -> list[Point]:
        """The best points of the laws: by a scan, or beside forces there are to first order."""
        points, inner = [], []
        for law in laws:
            point = known.get(law[0].strength[0])
            if tryout.before and point is None and not isinstance(law[0], CommandEffect):
                inner.append(law)
            elif (there := _beside(law, point)) and meter.affords(law[0].title):
                points.append(search(tryout, there, motion, meter, point))
        found = fitted(tryout, points, meter, before)
        return found + beside_others(tryout, inner, meter) if inner else found

    # Of a mass that a controller holds against its friction first order says nothing: strengths
    # that gained 195 in log likelihood had a score of zero.
    in_loop = state.etfe.direct or state.etfe.through_reference
    found = looked_for(firsts if in_loop else to_scan(tryout, firsts, {}, meter), {})
    known = {point.effect.strength[0]: point for point in found}
    for point in [one for one in known.values() if worth_following(one, known.values())]:
        laws = [_beside(law, point) for law in others if law[0].contains(point.effect)]
        found += containing(tryout, point, laws, meter)
    rest = [law for law in others if not any(law[0].contains(p.effect) for p in known.values())]
    # Where a limit is gradual says nothing of where it would be hard.
    alike = {name: p for name, p in known.items() if not isinstance(p.effect, CommandEffect)}
    found = looked_for(to_scan(tryout, rest, alike, meter), alike, found)
    trials = [force_trial(tryout, point) for point in found]
    return trials if in_loop else trials + in_the_place_of_one(trials, meter)


def trial_of(
    kind: type[NonlinearEffect],
    state: State,
    meter: Meter,
) -> Trial | None:
    """The trial of one law of a force; None where it convinces neither in a scan nor fitted.

    Parameters
    ----------
    kind : type of NonlinearEffect
    state : State
    meter : Meter
        Says whether that is affordable.
    """
    recording = simulated_in(state)
    if recording is None or not meter.affords(kind.title):
        return None
    tryout = Tryout(state, recording)
    motion = tryout.simulation.motions(state.fit.theta, (MOTOR, LOAD, CONNECTION))
    best = search(tryout, list(kind.candidates(state.model, motion)), motion, meter)
    if not thresholds.convincing(best.gain_fit, best.gain_choose, 1):
        return None
    trials = [force_trial(tryout, point) for point in fitted(tryout, [best], meter)]
    return next((trial for trial in trials if trial.convincing), None)


def _beside(variants: Variants, known: Point | None) -> Variants:
    """Variants of the same kind of force at its own place, where it is known by another law."""
    return [e for e in variants if known is None or e.place == known.effect.place]
