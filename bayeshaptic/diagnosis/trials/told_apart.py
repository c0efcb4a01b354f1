"""Linear effects that were not told apart, once more beside what was found after them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from bayeshaptic.diagnosis import acceptance
from bayeshaptic.diagnosis.state import State, Trial, worth

_AS_GOOD = 1.0  # of log likelihood, within which a search has led to the same fit


def told_apart(
    state: State,
    without: Callable[[State, int], State | None],
    trials: Callable[[State], list[Trial]],
) -> State:
    """The state with each earlier tie decided anew beside what has been accepted since.

    A spring and a second mode did equally well where a lag was not known of yet, and the spread
    between their limits stayed when the lag had told them apart.  The very same state is returned
    where nothing was tied.

    Parameters
    ----------
    state : State
    without : callable
        A state without its accepted effect of an index; None where there is none.
    trials : callable
        Trials of linear effects on a state.
    """
    for index, one in enumerate(state.accepted[:-1]):
        if one.change and one.change.effect and one.limit_log_sd > 0:
            bare = without(state, index)
            found = trials(bare) if bare else []
            state = _decided(state, index, [trial for trial in found if trial.convincing])
    return state


def _decided(state: State, index: int, found: list[Trial]) -> State:
    """The state with what does best in the place of an effect, or with what still ties with it.

    As it is where the search did not find the effect again: it may have missed others, too.
    """
    one = state.accepted[index]
    again = next((trial for trial in found if trial.name == one.name), None)
    if again is None or worth(again.state.fit) < worth(state.fit) - _AS_GOOD:
        return state
    best = max(found, key=lambda trial: trial.score)
    near = [trial for trial in found if acceptance.ties(best, trial)]
    *rest, accepted = acceptance.with_ties(again if again in near else best, near).accepted
    if again in near:
        accepted = replace(one, ties=accepted.ties, limit_log_sd=accepted.limit_log_sd)
        return replace(state, accepted=(*rest[:index], accepted, *rest[index:]))
    return replace(best.state, accepted=(*rest[:index], accepted, *rest[index:]))
