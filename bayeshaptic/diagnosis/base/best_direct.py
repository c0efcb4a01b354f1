"""Choosing the base model by the direct method, where each of them may lack something.

Base models are compared before anything is known of a force, and in closed loop dry friction passes
for a second mode, a hand or a base that gives.  So friction is tried on the other base models as
well.  Where it is likelier there, or does not explain all that the chosen one leaves, the loop is
closed on the others, too.  The direct method cannot hold windows out, so that a wrong model may
leave what looks like noise: only the likeliest explanation counts, and where it does not stand by
itself, no other takes its place.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.base.begun import Begun, base_of
from bayeshaptic.diagnosis.base.best_base import criterion
from bayeshaptic.diagnosis.state import State, Trial
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, Traced
from bayeshaptic.diagnosis.trials.direct import rubs, stands, trace_directly, untraced, with_trial
from bayeshaptic.diagnosis.trials.nonlinear import trial_of
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.inference.choose import UNDECIDED, Choice
from bayeshaptic.inference.criterion import information_criterion
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.stability.critical import critical_stiffness

_ONE_MASS = "rigid"


def traced_directly(begun: Begun, meter: Meter) -> tuple[Begun, Traced]:
    """The loop closed on the chosen base model, and on others that may be likelier with friction.

    Parameters
    ----------
    begun : Begun
        Fitted to all lines.
    meter : Meter
        Says whether one more fit is affordable.

    Returns
    -------
    begun : Begun
        With the base model whose explanation is the likeliest.
    traced : Traced
        Whether it stands is not asked.
    """
    chosen = begun.fit.model.name
    own = untraced(State(begun.etfe, begun.fit))
    if chosen == _ONE_MASS:  # is followed in time instead, with its friction
        return begun, own
    # Before the long ways on a base model that may be the wrong one.
    rubbing = _rubbing(begun, meter) if begun.choice is not None else {}
    own = trace_directly(own, meter)
    settled = own.verdict == CONSISTENT or (rubs(own) and own.verdict == EXPLAINED)
    if begun.choice is None or (settled and not _is_likelier(rubbing, own)):
        return begun, own
    found = {chosen: own}
    for name in _rivals(begun.choice):
        etfe, fit = base_of(begun, name)
        other = untraced(State(etfe, fit))
        found[name] = trace_directly(other, meter)
        if name in rubbing and not found[name].state.accepted:  # there was nothing left for it
            found[name] = with_trial(other, rubbing[name])
    best = _likeliest(found)
    if rubs(found[best]) and _may_be_one_mass(begun.choice, best):
        etfe, fit = base_of(begun, _ONE_MASS)
        choice = replace(begun.choice, fit=fit)
        one = untraced(State(etfe, fit))
        return replace(begun, etfe=etfe, fit=fit, choice=choice), one
    if best == chosen:
        return begun, own
    etfe, fit = base_of(begun, best)
    titles = " and ".join(effect.title for effect in found[best].state.accepted) or "no effect"
    less = criterion(own, 1.0) - criterion(found[best], 1.0)
    said = f" With what each of them lacks {best} is the likeliest, with {titles} (BIC {less:,.0f} "
    said += f"lower than that of {chosen})."
    choice = replace(begun.choice, fit=fit, reason=begun.choice.reason + said)
    return replace(begun, etfe=etfe, fit=fit, choice=choice), found[best]


def _rubbing(begun: Begun, meter: Meter) -> dict[str, Trial]:
    """Dry friction on the other base models in question, where it convinces."""
    assert begun.choice is not None
    found = {}
    for name in _rivals(begun.choice):
        trial = trial_of(CoulombFriction, State(*base_of(begun, name)), meter)
        if trial is not None:
            found[name] = trial
    return found


def _is_likelier(rubbing: Mapping[str, Trial], own: Traced) -> bool:
    """Whether another base model with dry friction is likelier than what leaves noise.

    A second mode stands in for friction, or friction for a hand, and no test sees it: of two such
    loops 1.11 and 1.12 times the limit were recommended, and friction in a hand was likelier by a
    BIC of 1,768 and 6,101.  Where none was found on the chosen one, that friction convinces on
    another is enough: a scan of its strengths gains 2 at most in loops without any.
    """
    least = min(
        (information_criterion(trial.state.fit, 1.0, 1) for trial in rubbing.values()),
        default=np.inf,
    )
    return bool(rubbing) and (not rubs(own) or least < criterion(own, 1.0) - UNDECIDED)


def _may_be_one_mass(choice: Choice, name: str) -> bool:
    """Whether one mass does as well as a base model before anything is known of its friction.

    Then that is followed in time: of one mass that rubs the hand of a grasped one with Stribeck's
    friction took the place, by chance.
    """
    one = choice.candidates.get(_ONE_MASS)
    return one is not None and one.score < choice.candidates[name].score


def _rivals(choice: Choice) -> tuple[str, ...]:
    """The simplest that somebody holds and the simplest that nobody does: a mode is an effect."""
    sizes = {
        name: one.fit.model.size for name, one in choice.candidates.items() if name != _ONE_MASS
    }
    simplest = {
        min(
            (name for name in sizes if choice.candidates[name].held == held),
            key=lambda name: sizes[name],
            default=None,
        )
        for held in (False, True)
    }
    return tuple(name for name in sizes if name in simplest - {choice.fit.model.name})


def _likeliest(found: dict[str, Traced]) -> str:
    """Of what is the likeliest; where it stands, of what stands nearly as well the lowest limit."""
    scores = {name: criterion(traced, 1.0) for name, traced in found.items()}
    best = min(scores, key=lambda name: scores[name])
    alike = [
        name
        for name, traced in found.items()
        if scores[name] < scores[best] + UNDECIDED and stands(traced)
    ]
    return min(alike, key=lambda name: _limit(found[name])) if best in alike else best


def _limit(traced: Traced) -> float:
    fit = traced.state.fit
    return float(critical_stiffness(fit.model, fit.theta).value)
