"""Which laws of forces are called for by what tests see."""

from __future__ import annotations

from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.search import Variants
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, Motion, NonlinearEffect


def called_for(
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
