"""All tests of the residual of a fit."""

from __future__ import annotations

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.causal import causal_tests
from bayeshaptic.diagnosis.residuals.drift import drift_tests
from bayeshaptic.diagnosis.residuals.excess import excess_noise_test
from bayeshaptic.diagnosis.residuals.periods import change_tests
from bayeshaptic.diagnosis.residuals.pieces import force_in_pieces
from bayeshaptic.diagnosis.residuals.residual import (
    Test,
    chi_square_score,
    frequency_tests,
    smooth_columns,
)
from bayeshaptic.diagnosis.residuals.ripples import ripple_tests
from bayeshaptic.diagnosis.residuals.supply import speed_tests
from bayeshaptic.diagnosis.samples.mend import SampleLook, measurement_tests
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.types import Floats


def is_periodic(etfe: Etfe) -> bool:
    """Whether the residual repeats from period to period, and there is the motion of one."""
    return isinstance(etfe.spectra, PeriodicSpectra) and etfe.unbroken is not None


def residual_tests(
    fit: Fit, etfe: Etfe, look: SampleLook | None = None, acted: Floats | float = 0.0
) -> tuple[Test, ...]:
    """All tests that a measurement of this kind gets.

    In closed loop the command answers to the noise, so that anything looks like drift, and a device
    that rests at its target looks like a sensor that hangs: neither is tested for there.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    look : SampleLook, optional
        What the samples showed, where they were looked at before.
    acted : ndarray, shape (N,), or 0
        What forces that were taken off add to the position.
    """
    if is_periodic(etfe):
        return periodic_tests(fit, etfe)
    if etfe.direct:
        return causal_tests(fit, etfe, acted)
    if etfe.through_reference:
        return (*frequency_tests(fit), *force_in_pieces(fit, etfe))
    return (*model_tests(fit, etfe), *measurement_tests(fit, etfe, look))


def model_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """Those of a random recording that ask whether the model is right."""
    return (
        *frequency_tests(fit),
        *force_in_pieces(fit, etfe),
        *drift_tests(fit, etfe),
        *excess_noise_test(fit, etfe),
        *ripple_tests(fit, etfe),
        *speed_tests(fit, etfe),
    )


def periodic_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """The tests over frequency, of what changes from line to line, and of what changes in time.

    No linear dynamics change from line to line outside narrow resonances; harmonics that beat with
    each other do.
    """
    columns, residual, _ = smooth_columns(fit)
    rest = float(residual @ residual - sum((columns.T @ residual) ** 2))
    freedom = len(residual) - columns.shape[1] - fit.model.size
    score = chi_square_score(rest, max(freedom, 1))
    text = (
        f"what changes from line to line, as no smooth response does, is {score:.1f} standard "
        "deviations above noise, and repeats from period to period"
    )
    jagged = Test("line to line", "nonlinear", score, thresholds.normal(), None, text)
    return (*frequency_tests(fit), jagged, *change_tests(fit, etfe))
