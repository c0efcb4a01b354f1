"""How far a model is from a measurement, in the form of ``summary.json``."""

from __future__ import annotations

from typing import Any

import numpy as np

from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.state import REPORT, held_out_rms, share
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness


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

    What was taken off a response was part of it, and of its noise, for the model as declared: its
    error beside that is no measure of what was gained.  It is compared as it is, not fitted again,
    so that all of the other measurement is held out.

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
    """The model's median limit over that of a measured response, dB."""
    with np.errstate(divide="ignore", invalid="ignore"):
        db = 20 * np.log10(analysis.limit.quantile(0.5) / own.q50) if own.q50 else np.nan
    return {"critical_stiffness_db": float(db) if np.isfinite(db) else None}
