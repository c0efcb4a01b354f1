"""A closed loop: the analysis with what explains the residual, and the error before and after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from bayeshaptic.diagnosis.analysis import Analysis, limit_line
from bayeshaptic.diagnosis.feedback.explain import ForceExplained
from bayeshaptic.diagnosis.state import Accepted
from bayeshaptic.diagnosis.traced import UNEXPLAINED, Traced
from bayeshaptic.diagnosis.widening.discrepancy import changing_at_limit
from bayeshaptic.diagnosis.widening.friction import may_be_held_by_friction
from bayeshaptic.models import Model
from bayeshaptic.shown import Shown


@dataclass(frozen=True, repr=False)
class Closed(Shown):
    """The result of closing the loop on one measurement.

    Attributes
    ----------
    base : Analysis
        With the model as declared.
    analysis : Analysis
        With the accepted effects, and the limit widened by what is unexplained.
    traced : Traced
    before, after : mapping
        Errors in the form of ``summary.json``, each against its own measurement.
    before_like_after : mapping or None
        Of the model as declared against the measurement that `after` is against, where something
        was taken off that or it is a part; None where it is the one that `before` is against.
    force : ForceExplained or None
        The force as the motion explains it, where nothing is read from the response.
    """

    base: Analysis
    analysis: Analysis
    traced: Traced
    before: Mapping[str, Any]
    after: Mapping[str, Any]
    force: ForceExplained | None = None
    before_like_after: Mapping[str, Any] | None = None

    @property
    def measured(self) -> Analysis:
        """The analysis with what was measured as it was measured."""
        return self.base

    @property
    def closed(self) -> Closed:
        """Itself: see `bayeshaptic.diagnosis.result`."""
        return self

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the effects that were accepted."""
        return tuple(effect.name for effect in self.effects)

    @cached_property
    def changing_at_limit(self) -> float:
        """See `bayeshaptic.diagnosis.widening`; kept: every headline of a page asks."""
        return changing_at_limit(self.analysis.limit, self.traced.state.fit, self.traced)

    @cached_property
    def may_be_held_by_friction(self) -> bool:
        """Whether a force that was found, and not explained, leaves noise as such friction does."""
        if self.verdict != UNEXPLAINED or all(e.family != "nonlinear" for e in self.effects):
            return False
        return may_be_held_by_friction(self.traced.state.fit, self.traced)

    @property
    def model(self) -> Model:
        """The model with its linear effects."""
        return self.analysis.model

    @property
    def effects(self) -> tuple[Accepted, ...]:
        """What was found, in the order in which it was accepted."""
        return self.traced.state.accepted

    @property
    def verdict(self) -> str:
        """ "consistent", "explained" or "unexplained"."""
        return self.traced.verdict

    @property
    def diagnosis(self) -> dict[str, Any]:
        """In the form of ``summary.json``."""
        return self.traced.table(self.analysis.stated.summary())

    def _lines(self) -> tuple[str, ...]:
        recording = self.base.recording
        of = "a frequency response" if recording is None else recording.name
        found = " and ".join(effect.title for effect in self.effects) or "nothing"
        return (
            f"Closed loop on {of}: {self.verdict}",
            f"added to the model {self.base.model.name}: {found}",
            limit_line(self.analysis),
        )
