"""A closed loop: the analysis with what explains the residual, and the error before and after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.analysis import Analysis, limit_line
from bayeshaptic.diagnosis.feedback.explain import ForceExplained
from bayeshaptic.diagnosis.state import REPORT, Accepted, held_out_rms, share
from bayeshaptic.diagnosis.traced import UNEXPLAINED, Traced
from bayeshaptic.diagnosis.widening.discrepancy import changing_at_limit
from bayeshaptic.diagnosis.widening.friction import may_be_held_by_friction
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness


@dataclass(frozen=True, eq=False, repr=False)
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
        return changing_at_limit(self.analysis.limit, self.traced)

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


def limit_alone(analysis: Analysis) -> dict[str, Any]:
    """Errors of an analysis that is not compared with the response: its limit.

    Parameters
    ----------
    analysis : Analysis
    """
    q05, q50, q95 = analysis.limit.quantile(np.array([0.05, 0.5, 0.95]))
    return {"critical_stiffness": {"q05": float(q05), "q50": float(q50), "q95": float(q95)}}


def model_error(analysis: Analysis) -> dict[str, Any]:
    """How far the model of an analysis is from its own measurement.

    Parameters
    ----------
    analysis : Analysis
    """
    fit = analysis.fit
    return {
        "weighted_rms": float(np.sqrt(fit.reduced_chi_square)),
        "held_out_weighted_rms": held_out_rms(fit),
        **_of_response(fit, analysis.etfe),
        **limit_alone(analysis),
        **_of_limit(analysis, analysis.etfe_limit),
    }


def error_beside(declared: Analysis, other: Analysis) -> dict[str, Any]:
    """How far the model of one analysis is from the measurement of another.

    What was taken off a response was, for the model as declared, part of the response and of its
    noise; its error beside the response as measured is therefore no measure of what was gained.
    Here the declared model is compared with the other measurement as it is and not fitted again, so
    that all of that measurement is held out.

    Parameters
    ----------
    declared : Analysis
        Whose model it is.
    other : Analysis
        Whose measurement it is.
    """
    fit, windows = declared.fit, other.fit.windows
    theta, out = fit.theta[None], windows.part(share(windows, REPORT))
    left = Likelihood(fit.model, out).normalised(theta)[0]
    return {
        "weighted_rms": float(np.sqrt(Likelihood(fit.model, windows).reduced_chi_square(theta)[0])),
        "held_out_weighted_rms": float(np.sqrt(np.mean(np.abs(left) ** 2))),
        **_of_response(fit, other.etfe),
        **limit_alone(declared),
        **_of_limit(declared, other.etfe_limit),
    }


def _of_response(fit: Fit, etfe: Etfe) -> dict[str, float]:
    ratio = fit.response(etfe.frequency_hz) / etfe.value
    return {
        "gain_db_rms": float(np.sqrt(np.mean((20 * np.log10(np.abs(ratio))) ** 2))),
        "phase_deg_rms": float(np.sqrt(np.mean(np.degrees(np.angle(ratio)) ** 2))),
    }


def _of_limit(analysis: Analysis, own: EtfeCriticalStiffness) -> dict[str, float | None]:
    """The model's median limit over that of a measured response, in dB."""
    with np.errstate(divide="ignore", invalid="ignore"):
        db = 20 * np.log10(analysis.limit.quantile(0.5) / own.q50) if own.q50 else np.nan
    return {"critical_stiffness_db": float(db) if np.isfinite(db) else None}
