"""The loop on a periodic recording, in the form that the report and the discrepancy read."""

from __future__ import annotations

from collections.abc import Callable

from bayeshaptic.diagnosis.periodic.loop import PeriodicLoop, close_periodic
from bayeshaptic.diagnosis.traced import CONSISTENT, EXPLAINED, UNEXPLAINED, Candidate, Traced
from bayeshaptic.inference.least_squares import Fit
from bayeshaptic.recordings.response.etfe import Etfe


def trace_periodic(etfe: Etfe, fit: Fit, tick: Callable[[str], None] | None = None) -> Traced:
    """Run the loop on a base model fitted to a periodic recording.

    Parameters
    ----------
    etfe : Etfe
        Periodic, with its recording.
    fit : Fit
    tick : callable, optional
        Called with what is being tried.

    Returns
    -------
    Traced
    """
    return traced(close_periodic(etfe, fit, tick))


def traced(loop: PeriodicLoop) -> Traced:
    """Verdict, class of what remains, and the record of candidates."""
    candidates = tuple(
        Candidate(a.name, a.title, a.score, any(a is c for c in loop.chosen), number)
        for number, attempts in enumerate(loop.history, 1)
        for a in attempts
    )
    left = [test for test in loop.after if test.flagged]
    verdict, residual_class = CONSISTENT, None
    if left:
        verdict, residual_class = UNEXPLAINED, max(left, key=lambda test: test.excess).family
    elif loop.chosen:
        verdict, residual_class = EXPLAINED, loop.chosen[0].family
    return Traced(verdict, residual_class, loop.state, loop.before, loop.after, candidates)
