"""What closing the loop found: the verdict, and the record of what was tried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import Accepted, State, Trial
from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import Fit

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
        Trials of the last round that were good but not accepted, and forces that gained anything:
        how else it could be.
    path : tuple of State
        From the base model on, one for each time that something was accepted.
    skipped : tuple of str
        What was not tried because the budget was spent.
    before_forces : tuple of Test
        The tests of the residual before the first force was taken off: what a low-pass hid shows
        beside that low-pass.
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
    before_forces: tuple[Test, ...] = ()

    @property
    def without_forces(self) -> Fit | None:
        """The last fit on the way from which no force was taken off; None where none is known.

        What a force moved is told beside it: what linear effects moved before is theirs.
        """
        bare = (one for one in reversed(self.path) if not _has_force(one))
        return next((one.fit for one in bare), None)

    def table(self, posterior: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        """In the form of ``summary.json``.

        Parameters
        ----------
        posterior : mapping
            Summary of the model's parameters, the accepted effects' among them.
        """
        return {
            "verdict": self.verdict,
            "residual_class": self.residual_class,
            "effects": [_effect(effect, posterior) for effect in self.state.accepted],
            "candidates": [
                {"name": c.name, "score": c.score, "accepted": c.accepted} for c in self.candidates
            ],
            "not_tried": list(self.skipped),
        }

    @property
    def notices(self) -> tuple[Notice, ...]:
        """What a reader should know of what is left, and of what was not tried."""
        found = []
        if self.verdict == UNEXPLAINED:
            left = max((test for test in self.after if test.flagged), key=lambda test: test.excess)
            text = (
                f"The residual is not explained ({self.residual_class}): {left.text}. The critical "
                "stiffness is widened by what remains; treat its upper half with suspicion."
            )
            found.append(Notice("warning", "unexplained", text))
        if any(effect.limit_log_further > 0 for effect in self.state.accepted):
            text = (
                "The device was still changing when the recording ended, and may go on: for half "
                "of the draws the limit falls as far again as it did in the recording. Record it "
                "once more when it has settled."
            )
            found.append(Notice("warning", "drift", text))
        if self.skipped:
            text = (
                "Not tried, because the budget of the search for effects was spent: "
                f"{', '.join(self.skipped)}; a larger --budget tries them."
            )
            found.append(Notice("note", "budget", text))
        return tuple(found)


def _has_force(state: State) -> bool:
    return any(effect.family == "nonlinear" for effect in state.accepted)


def _effect(effect: Accepted, posterior: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    keys = ("mean", "sd", "q05", "q50", "q95", "unit")
    parameters = {name: {k: posterior[name][k] for k in keys} for name in effect.parameters}
    for name, estimate in effect.estimates.items():
        sd = estimate.sd if np.isfinite(estimate.sd) else None
        reach = 1.6449 * sd if sd is not None else 0.0
        parameters[name] = {
            "mean": estimate.mean,
            "sd": sd,
            "q05": estimate.mean - reach,
            "q50": estimate.mean,
            "q95": estimate.mean + reach,
            "unit": estimate.unit,
        }
    return {
        "name": effect.name,
        "title": effect.title,
        "parameters": parameters,
        "evidence": effect.evidence,
        "ties": list(effect.ties),
        "probabilities": dict(effect.probabilities),
    }


def share_left(traced: Traced, family: str) -> float:
    """What tests of a class still see after an effect of it was taken off, over what they saw."""
    before, after = (
        max((test.statistic for test in tests if test.family == family), default=0.0)
        for tests in ((*traced.before, *traced.before_forces), traced.after)
    )
    return float(np.clip(after / before, 0.0, 1.0)) if before > 0 else 1.0
