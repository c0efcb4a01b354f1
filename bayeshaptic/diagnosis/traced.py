"""What closing the loop found: the verdict, and the record of what was tried."""

from __future__ import annotations

from dataclasses import dataclass

from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import State, Trial

CONSISTENT, EXPLAINED, UNEXPLAINED = "consistent", "explained", "unexplained"


@dataclass(frozen=True)
class Candidate:
    """A candidate effect in the record of the loop.

    Attributes
    ----------
    name, title : str
    score : float
        Gain in log likelihood on windows that took no part in the fit, less two a parameter; of
        measurement effects the statistic of their own test.
    accepted : bool
    round : int
        From 1; 0 for what was wrong with the measurement itself.
    taken_out : bool
        Whether it was accepted and a later one made it needless.
    """

    name: str
    title: str
    score: float
    accepted: bool
    round: int
    taken_out: bool = False


@dataclass(frozen=True)
class Traced:
    """What the loop found.

    Attributes
    ----------
    verdict : {"consistent", "explained", "unexplained"}
    residual_class : str or None
        Class of what remains ("unexplained"), else of the first effect found.
    state : State
        Measurement, model and fit with the accepted effects.
    before, after : tuple of Test
        The tests of the residual before and after.
    candidates : tuple of Candidate
    rejected : tuple of Trial
        Trials of the last round that were good but not accepted: how else it could be.
    path : tuple of State
        From the base model on, one for each time that something was accepted.
    skipped : tuple of str
        What was not tried because the budget was spent.
    """

    verdict: str
    residual_class: str | None
    state: State
    before: tuple[Test, ...]
    after: tuple[Test, ...]
    candidates: tuple[Candidate, ...] = ()
    rejected: tuple[Trial, ...] = ()
    path: tuple[State, ...] = ()
    skipped: tuple[str, ...] = ()
