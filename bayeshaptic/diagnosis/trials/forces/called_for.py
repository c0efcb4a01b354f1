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
        if state.etfe.parts and issubclass(kind, CommandEffect):
            continue  # pieces are not asked whether an actuator's limit falls with its speed
        near = [e for e in kind.candidates(state.model, motion) if not is_there(e, state)]
        called = [e for e in near if e.called_for(over)]
        if called and kind.strength[0] in firsts:
            others.append(called)
        elif called:
            firsts[kind.strength[0]] = called
    return list(firsts.values()), others


def is_there(effect: NonlinearEffect, state: State) -> bool:
    """Whether the state has the effect where it acts, or another law of the same thing.

    A mass has one friction, and an actuator one characteristic: a second law on top of the first
    would only mend it.  Another mass may rub as well.
    """
    actuators = {kind.name for kind in effects("nonlinear") if issubclass(kind, CommandEffect)}
    for accepted in state.accepted:
        acting = None if accepted.change is None else accepted.change.acting
        if isinstance(effect, CommandEffect) and accepted.name in actuators:
            return True
        alike = effect.name == accepted.name or effect.strength[0] in accepted.estimates
        if alike and (acting is None or acting.effect.place == effect.place):
            return True
    return False
