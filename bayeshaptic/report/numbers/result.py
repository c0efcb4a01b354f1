"""What a report is about: an analysis, or a closed loop with an analysis before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.diagnosis.traced import UNEXPLAINED

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.stability.critical import CriticalStiffness


def families_of(result: Result) -> frozenset[str]:
    """The classes of what closing the loop found; empty without it."""
    closed = result.closed
    return frozenset() if closed is None else frozenset(e.family for e in closed.effects)


def is_unexplained(result: Result) -> bool:
    """Whether closing the loop left something without a name."""
    return result.closed is not None and result.closed.verdict == UNEXPLAINED


def may_be_held(analysis: Analysis) -> bool:
    """Whether somebody holds the device, or nobody said that nobody does."""
    tried = {} if analysis.choice is None else analysis.choice.candidates
    return analysis.model.held or any(one.held for one in tried.values())


def said_who_holds(analysis: Analysis) -> bool:
    """Whether somebody said who holds the device, or that nobody does."""
    tried = {} if analysis.choice is None else analysis.choice.candidates
    return len({one.held for one in tried.values()}) < 2


def hides_hand(analysis: Analysis) -> bool:
    """Whether the device is read through a reference that a hand, if there is one, hides behind.

    Not where that moves the force at nearly all frequencies, as noise that was added to it does.
    """
    etfe = analysis.etfe
    return etfe.through_reference and not etfe.moved_throughout and may_be_held(analysis)


def tip_limit(analysis: Analysis) -> CriticalStiffness | None:
    """The limit at the tip in N/m; None without a lever arm or without a torque in N m."""
    if analysis.lever_m is None or analysis.limit.unit != "N m/rad":
        return None
    return analysis.limit.tip(analysis.lever_m)
