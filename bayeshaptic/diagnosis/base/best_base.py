"""Which base model, when each of them may lack something.

A mode or a spring that the right base model lacks can make a wrong one fit better: a second mode
looks like a hand, a hand like a spring and a base that gives.  So where the base model that was
chosen misfits, or its hand is like none, the loop is closed on the others, too, and they are
compared with their effects.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.base.alignment import realigned
from bayeshaptic.diagnosis.base.begun import Begun, base_of, fitted, refitted
from bayeshaptic.diagnosis.base.loops_in_turn import LoopsInTurn, parameters_of
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.traced import EXPLAINED, UNEXPLAINED, Traced
from bayeshaptic.inference.choose import Choice
from bayeshaptic.inference.criterion import (
    BARE_MENTION,
    VERY_STRONG,
    ScoredFit,
    information_criterion,
)
from bayeshaptic.inference.fit import MISFIT, Fit
from bayeshaptic.inference.loop_response import as_of_the_loop, hardly_differ
from bayeshaptic.models import Model
from bayeshaptic.numerics.spending import RATE, counting, metered

_SEVERAL = 2  # linear effects: one is no sign that rows are not of one sample
_MOST_AGAIN = 2  # times that the loop is closed again
_OWN = 0.6  # of the budget for the base model that was chosen, where others are in question


def traced_as_of_the_loop(
    begun: Begun, model: str | Model, options: Options
) -> tuple[Begun, Traced]:
    """Close the loop, and close it again where what was found changes the measurement itself.

    That is so where the found effects change what moves between the samples (of a velocity or a
    measured force), and where they show that force and position do not belong to the same instant;
    other effects may have been added only to make up for that.

    Parameters
    ----------
    begun : Begun
    model : str or Model
        As asked for.
    options : Options
    """
    with metered(options.budget_s * RATE) as meter:
        begun, traced = traced_from_best_base(begun, options)
    for fit in _on_the_way(traced):
        again = realigned(begun, fit, model, options)
        if again is not None:
            return traced_as_of_the_loop(fitted(again, model, options), model, options)
    for _ in range(_MOST_AGAIN):
        etfe = as_of_the_loop(begun.measured, traced.state.fit)
        left_s = options.budget_s - meter.spent / RATE
        if hardly_differ(etfe, begun.etfe) or left_s <= 0:
            break
        with counting(meter):
            again = refitted(begun, etfe, model, options)
            begun, traced = traced_from_best_base(again, replace(options, budget_s=left_s))
    return begun, traced


def _on_the_way(traced: Traced) -> Iterator[Fit]:
    """The fits with some of the linear effects, where more than one was found."""
    if len(traced.state.model.effects) < _SEVERAL:
        return
    for state in traced.path[1:]:
        if len(state.accepted) == len(state.model.effects):
            yield state.fit


def traced_from_best_base(begun: Begun, options: Options) -> tuple[Begun, Traced]:
    """Close the loop, on every base model in question where the chosen one misfits.

    Parameters
    ----------
    begun : Begun
    options : Options
        Its progress is that of the loop.

    Returns
    -------
    begun : Begun
        With the base model whose explanation is the best.
    traced : Traced
    """
    rivals, doubted = _rivals(begun), _hardly_worse(begun)
    share = _OWN if rivals or doubted else 1.0
    loops = LoopsInTurn(begun, options)
    own = loops.begin(begun.fit.model.name, share * options.budget_s)
    loops.glance(rivals)
    own.go_on(loops.patient)
    while not (rivals or own.done):
        own.go_on()
    if not rivals and own.traced.verdict == UNEXPLAINED:
        rivals = doubted or _beside_a_force(begun, own.traced)
    elif own.done and _stands_alone(own.traced, begun, rivals):
        rivals = ()
    if rivals:
        loops.take_turns(rivals)
    best = _best_of(loops) if rivals else begun.fit.model.name
    # With what was found a mass may have run away, which had not in the fit without.
    simpler = _simpler(begun, loops.running[best].traced.state.fit)
    if set(simpler) - set(rivals):
        rivals = tuple(dict.fromkeys((*list(loops.running)[1:], *simpler)))
        loops.take_turns(rivals)
        best = _best_of(loops)
    if not rivals:
        return begun, own.traced
    assert begun.choice is not None
    etfe, fit = base_of(begun, best)
    found, noise = _explanations(loops)
    said = _said(best, found, noise, loops.given_up)
    choice = replace(begun.choice, fit=fit, reason=begun.choice.reason + said)
    return replace(begun, etfe=etfe, fit=fit, choice=choice), found[best]


def _rivals(begun: Begun) -> tuple[str, ...]:
    """The base models that could be right instead; none where the chosen one was asked for or fits.

    A hand that is like no hand counts as a misfit.  A rigid device with a mode is a free one, and a
    free one with a mode on its body is a chain.  One with a mode on its motor is no chain: so
    beside a chain that misfits, the free device is tried, too.  A device of which a mass has run
    away is one of fewer masses with what it lacks: on the spring of a joystick, say, whose other
    end is no mass but the ground.
    """
    choice = begun.choice
    if choice is None:
        return ()
    chosen = choice.candidates[begun.fit.model.name]
    like_no_hand = 11.1  # chi-square of five numbers: one hand in twenty
    simpler = _simpler(begun, begun.fit)
    if begun.fit.reduced_chi_square < MISFIT and chosen.from_a_hand < like_no_hand:
        return simpler
    others = {name: one for name, one in choice.candidates.items() if name != "rigid"}
    if begun.fit.model.name == "rigid":
        return tuple(name for name in others if name != "chain-2")
    best = _best_other(choice, chosen)
    beside = ["free"] if begun.fit.model.name == "chain-2" and "free" in others else []
    return tuple(dict.fromkeys((*simpler, *best, *beside)))


def _simpler(begun: Begun, fit: Fit) -> tuple[str, ...]:
    """The base models without a mass that has run away in a fit, as on a spring to the ground.

    And one mass without a hand, where it is one mass that a hand explains: a spring may as well.
    """
    name, known = fit.model.name, {} if begun.choice is None else begun.choice.candidates
    fewer = {"free": ("rigid",), "chain-2": ("rigid", "free")}.get(name, ()) if fit.run_away else ()
    if name in known and known[name].as_one_mass:
        fewer = ("rigid",)
    return tuple(n for n in fewer if n in known)


def _best_other(choice: Choice, chosen: ScoredFit) -> tuple[str, ...]:
    """The best with a hand where the chosen one has none, and the other way round."""
    there = [
        (one.score, name)
        for name, one in choice.candidates.items()
        if one.held != chosen.held and name != "rigid"
    ]
    return tuple(name for _, name in sorted(there)[:1])


def _beside_a_force(begun: Begun, own: Traced) -> tuple[str, ...]:
    """The best other base model, where a force was found that was not known when one was chosen.

    Strong friction makes a free device look held: the choice was made on a motion that is not
    linear.  The other way round nothing has to be tried: no force hides a hand, and a hand that the
    response does not show would explain what the force leaves as its own motion.
    """
    choice = begun.choice
    if choice is None or not any(one.family == "nonlinear" for one in own.state.accepted):
        return ()
    chosen = choice.candidates[begun.fit.model.name]
    return _best_other(choice, chosen) if chosen.held else ()


def _hardly_worse(begun: Begun) -> tuple[str, ...]:
    """The best base models of the other kind (held or not held) that fit nearly as well.

    A hand that hardly holds looks like a third mass, and its own motion like noise of the device.
    """
    choice = begun.choice
    if choice is None:
        return ()
    chosen = choice.candidates[begun.fit.model.name]
    return tuple(
        name
        for name, other in choice.candidates.items()
        if other.held != chosen.held and other.score - chosen.score < VERY_STRONG
    )


def _stands_alone(own: Traced, begun: Begun, rivals: tuple[str, ...]) -> bool:
    """Whether a base model lacks nothing, or one effect, and is then the simplest that there is."""
    if begun.fit.run_away:
        return False
    sizes = [begun.choice.candidates[name].fit.model.size for name in rivals if begun.choice]
    simple = own.verdict == EXPLAINED and len(own.state.accepted) == 1
    least = simple and all(begun.fit.model.size < size for size in sizes)
    return least or (own.verdict != UNEXPLAINED and not own.state.accepted)


def _comparable(
    found: Mapping[str, Traced], noise: float, given_up: Collection[str]
) -> Mapping[str, Traced]:
    """Of the loops those that explain the recording; where none does, all of them.

    A loop with a hand does not count as explaining where models without one, with what they lack,
    predict the response better: a hand can take up what a force does to a device that nobody holds.
    """
    simple = {"rigid", "free"} - set(given_up)
    unheld = [criterion(one, noise) for name, one in found.items() if name in simple]
    least = min(unheld, default=np.inf)
    explains = {
        name: one
        for name, one in found.items()
        if one.verdict != UNEXPLAINED
        and (not one.state.fit.model.held or criterion(one, noise) < least)
    }
    return explains or found


def _explanations(loops: LoopsInTurn) -> tuple[Mapping[str, Traced], float]:
    """What each of the loops found, and the noise that they are compared in."""
    found = {name: loop.traced for name, loop in loops.running.items()}
    return found, max(1.0, min(one.state.fit.reduced_chi_square for one in found.values()))


def _best_of(loops: LoopsInTurn) -> str:
    return _best(*_explanations(loops), loops.given_up)


def _best(found: Mapping[str, Traced], noise: float, given_up: Collection[str] = ()) -> str:
    """The best loop: one that explains, then by BIC; of equals that with the fewest parameters.

    Each effect counts as one more, for its choice: a third mass with a spring is a hand.  And a
    mass more, above the band, takes up a drag: 1.07 times the limit.
    """
    among = _comparable(found, noise, given_up)
    behind = {name: criterion(traced, noise) for name, traced in among.items()}
    equals = [name for name in behind if behind[name] <= min(behind.values()) + BARE_MENTION]
    return min(equals, key=lambda name: (parameters_of(found[name].state), behind[name]))


def criterion(traced: Traced, noise: float) -> float:
    """BIC of the model with all effects; those that are not part of the model count as well."""
    beside = sum(len(effect.estimates) for effect in traced.state.accepted)
    return information_criterion(traced.state.fit, noise, beside)


def _said(best: str, found: Mapping[str, Traced], noise: float, given_up: Collection[str]) -> str:
    behind = {
        name: criterion(traced, noise) - criterion(found[best], noise)
        for name, traced in found.items()
    }
    words = []
    for name, traced in found.items():
        effects = ", ".join(effect.title for effect in traced.state.accepted) or "no effect"
        side = "worse" if behind[name] > 0 else "lower"
        compared = "" if name == best else f", BIC {abs(behind[name]):,.0f} {side}"
        verdict = f"{traced.verdict}{compared}"
        if name in given_up:
            verdict = "given up: more would be no simpler than what explains"
        words.append(f"{name} with {effects} ({verdict})")
    least = min(_comparable(found, noise, given_up), key=lambda name: behind[name])
    most = "as much with fewer parameters" if behind[least] < 0 else "the most"
    return f" With what each of them lacks, {best} explains {most}: {'; '.join(words)}."
