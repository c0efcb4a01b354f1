"""The four lights of the first screen: recording, fit, loop, sampler."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.recordings.checks.sufficiency import TOO_LITTLE
from bayeshaptic.report.numbers.held_still import held_still
from bayeshaptic.report.numbers.misfit import (
    misfit_factor,
    misfit_is_clear,
    misfit_is_faint,
    residual_is_noticed,
)
from bayeshaptic.report.numbers.result import is_unexplained
from bayeshaptic.report.numbers.stand_ins import stand_ins
from bayeshaptic.report.objections import unconfirmed, why_none

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

GOOD, DOUBT, BAD = "good", "doubt", "bad"
SIGNS = {GOOD: "\N{CHECK MARK}", DOUBT: "!", BAD: "\N{MULTIPLICATION SIGN}"}
_SEEN = {
    "consistent": (GOOD, "nothing to find"),
    "explained": (GOOD, "explained"),
    "unexplained": (DOUBT, "unexplained"),
}
# Warnings of these topics are of the fit, the loop or the sampler, and shown by their lights.
_ELSEWHERE = {"misfit", "unexplained", "residual", "critical stiffness"}
_SPOILING = {"feedback", TOO_LITTLE}


@dataclass(frozen=True)
class Light:
    """One light.

    Attributes
    ----------
    name : str
        "Recording", "Fit", "Loop" or "Sampler".
    state : {"good", "doubt", "bad"}
    word : str
        What it is, in two or three words.
    section : str
        Where on the page more of it stands.
    """

    name: str
    state: str
    word: str
    section: str

    @property
    def sign(self) -> str:
        """What stands for the colour where there is none."""
        return SIGNS[self.state]


def lights(result: Result) -> tuple[Light, ...]:
    """The four lights of a result."""
    analysis = result.analysis
    return _recording(result), _fit(result), _loop(result), _sampler(analysis)


def _recording(result: Result) -> Light:
    analysis = result.analysis
    found = {n.topic for n in analysis.notices if n.level == "warning"} - _ELSEWHERE
    # Feedback spoils the response, and not what a motion says that was followed through it.
    followed = analysis.in_loop is not None and not why_none(result)
    spoiling = _SPOILING - ({"feedback"} if followed else set())
    for topic in found & spoiling:
        return Light("Recording", BAD, topic, "notices")
    if found:
        return Light("Recording", DOUBT, ", ".join(sorted(found)), "notices")
    if result.closed is not None and held_still(result.closed) is not None:
        return Light("Recording", DOUBT, "held still", "measured")
    return Light("Recording", GOOD, "no objection", "measured")


def _fit(result: Result) -> Light:
    analysis = result.analysis
    if not analysis.sampled:
        return Light("Fit", DOUBT, "none was made", "leftover")
    if analysis.in_loop is not None:
        if analysis.in_loop.doubts:
            return Light("Fit", BAD, "in doubt", "force")
        return Light("Fit", GOOD, "motion is followed", "force")
    if misfit_is_clear(analysis):
        return Light("Fit", BAD, f"{misfit_factor(analysis)} times the noise", "leftover")
    if residual_is_noticed(analysis):
        return Light("Fit", BAD, "not noise", "notices")
    if misfit_is_faint(analysis):
        return Light("Fit", DOUBT, "slightly above noise", "leftover")
    left = "no larger than noise" if is_unexplained(result) else "only noise is left"
    return Light("Fit", GOOD, left, "leftover")


def _loop(result: Result) -> Light:
    closed = result.closed
    if closed is None:
        return Light("Loop", DOUBT, "left open", "assumptions")
    if closed.force is None and not closed.analysis.sampled:
        return Light("Loop", DOUBT, "nothing was tried", "notices")
    section = "force" if closed.force is not None else "lacked"
    state, word = _SEEN[closed.verdict]
    if state == GOOD and misfit_is_clear(closed.analysis):
        return Light("Loop", BAD, "misfit remains", section)
    if state == GOOD and stand_ins(closed) is not None:
        return Light("Loop", DOUBT, "other forces fit as well", section)
    return Light("Loop", state, word, section)


def _sampler(analysis: Analysis) -> Light:
    if not analysis.sampled:
        return Light("Sampler", DOUBT, "not run", "sampler")
    if not analysis.posterior.converged:
        return Light("Sampler", BAD, "not converged", "sampler")
    if unconfirmed(analysis):
        return Light("Sampler", BAD, "limits not confirmed", "sampler")
    return Light("Sampler", GOOD, "converged", "sampler")
