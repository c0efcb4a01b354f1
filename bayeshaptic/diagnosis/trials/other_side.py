"""Forces beside a low-pass that is on the other side of the masses than was thought.

See `bayeshaptic.effects.other_side`.
"""

from __future__ import annotations

from dataclasses import replace

from bayeshaptic.diagnosis import acceptance
from bayeshaptic.diagnosis.state import Accepted, State, Trial, log_likelihoods
from bayeshaptic.diagnosis.trials.linear import accepted_with
from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.other_side import on_the_other_side
from bayeshaptic.inference.least_squares import least_squares


def turned(state: State) -> State | None:
    """The state with its low-pass on the other side; None without one, or beside known forces.

    What those add was simulated with the low-pass where it is.
    """
    if acceptance.force_acts(state.accepted):
        return None
    found = on_the_other_side(state.model, state.etfe, state.fit.theta)
    if found is None:
        return None
    before = state.model.effects[found.index]
    accepted = tuple(
        _in_its_place(one, found.effect) if one.change and one.change.effect is before else one
        for one in state.accepted
    )
    fit = least_squares(found.model, state.etfe, start=found.theta)
    return State(state.etfe, fit, accepted)


def as_seen_from(state: State, other: State, trials: list[Trial]) -> list[Trial]:
    """Trials of another state, with the gains that they are over the first one."""
    here, there = (
        log_likelihoods(one.model, one.fit.windows, one.fit.theta) for one in (state, other)
    )
    fit, choose = (there - here).tolist()
    return [
        replace(trial, gain_fit=trial.gain_fit + fit, gain_choose=trial.gain_choose + choose)
        for trial in trials
    ]


def _in_its_place(one: Accepted, other: LinearEffect) -> Accepted:
    """An effect as part of the explanation, in the place of one that does the same."""
    ties = dict.fromkeys(name for name in (*one.ties, one.name) if name != other.name)
    return replace(
        accepted_with(other),
        evidence=one.evidence,
        ties=tuple(ties),
        limit_log_sd=one.limit_log_sd,
    )
