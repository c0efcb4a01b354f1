"""Which base model, of a recording in closed loop that lacks something.

The base models are compared before anything is known of a force, and in a loop dry friction passes
for a second mode, a hand or a base that gives.  So where friction does not explain all that the
chosen one leaves, the others are tried with what they lack, too.  Nothing can be held out there,
and a wrong model that leaves what looks like noise is a danger: what is the likeliest must stand by
itself, and nothing stands in its place.
"""

from __future__ import annotations

from dataclasses import replace

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.base.begun import Begun, base_of
from bayeshaptic.diagnosis.base.best_base import criterion
from bayeshaptic.diagnosis.battery import residual_tests
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, Traced
from bayeshaptic.diagnosis.trials.all_lines import rubs, stands, trace_by_all_lines, untraced
from bayeshaptic.diagnosis.trials.nonlinear import first_look
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.inference.choose import UNDECIDED, Choice
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Tick

_ONE_MASS = "rigid"


def traced_in_any_loop(
    begun: Begun, meter: Meter, tick: Tick | None = None
) -> tuple[Begun, Traced]:
    """The loop closed on the chosen base model, and on others where friction does not explain it.

    Parameters
    ----------
    begun : Begun
        Fitted to all lines.
    meter : Meter
        Says whether one more fit is affordable.
    tick : callable, optional
        Called with the title of each candidate that is fitted in full.

    Returns
    -------
    begun : Begun
        With the base model whose explanation is the likeliest.
    traced : Traced
        Whether it stands is not asked.
    """
    chosen = begun.fit.model.name
    own = untraced(State(begun.etfe, begun.fit), residual_tests(begun.fit, begun.etfe))
    if chosen == _ONE_MASS:  # is followed in time instead, with its friction
        return begun, own
    own = trace_by_all_lines(own, meter, tick)
    settled = rubs(own) and own.verdict == EXPLAINED
    if begun.choice is None or settled:
        return begun, own
    if own.verdict == CONSISTENT and not _rubs_on_another(begun, meter, tick):
        return begun, own
    found = {chosen: own}
    for name in _rivals(begun.choice):
        etfe, fit = base_of(begun, name)
        other = untraced(State(etfe, fit), residual_tests(fit, etfe))
        found[name] = trace_by_all_lines(other, meter, tick)
    best = _likeliest(found)
    if best == chosen:
        return begun, own
    etfe, fit = base_of(begun, best)
    titles = " and ".join(effect.title for effect in found[best].state.accepted) or "no effect"
    less = criterion(own, 1.0) - criterion(found[best], 1.0)
    said = f" With what each of them lacks {best} is the likeliest, with {titles} (BIC {less:,.0f} "
    said += f"lower than that of {chosen})."
    choice = replace(begun.choice, fit=fit, reason=begun.choice.reason + said)
    return replace(begun, etfe=etfe, fit=fit, choice=choice), found[best]


def _rubs_on_another(begun: Begun, meter: Meter, tick: Tick | None) -> bool:
    """Whether dry friction convinces on another base model, where the chosen one leaves noise.

    A second mode stands in for friction, or for that and a hand, and no test sees it: of such a
    loop 1.11 times the limit was recommended, and friction in a hand was likelier by a BIC of
    1,768.  A first look gains 2 at most in loops without any, 40 and more in three that rubbed.
    """
    assert begun.choice is not None
    for name in _rivals(begun.choice):
        gains = first_look(CoulombFriction, State(*base_of(begun, name)), meter, tick)
        if thresholds.convincing(*gains, 1):
            return True
    return False


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
