"""The response of the loop, where something other than a command and a position was sensed.

What happens between the samples depends on the model.  So each model is fitted to the response that
it makes of the measurement itself.  Without that the right model misfits, and a richer one stands
in for what is missing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from bayeshaptic.inference.fit import Fit
from bayeshaptic.models.response.between_samples import hidden_by_structure, with_images
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

_SAME = 0.1  # the chi-square that is no difference
_MOST_ROUNDS = 8  # fits to what the last one makes of the samples
_AS_DEEP = 1.01  # of the reduced chi-square: valleys no deeper than that are one
# How many times the reduced chi-square may grow in a round: beyond that the fit made of the samples
# what was not there.  Of 111 rounds of 30 velocities and accelerations five are refused, all of one
# recording, where it grew 14,000-fold and more.
_RUNS_AWAY = 2.0
_TOP = 0.2  # of the lines, where the motor's mass is nearly alone


class Fitting(Protocol):
    """How a model is fitted: from many starts, or from the one given."""

    def __call__(self, etfe: Etfe, start: Floats | None = None, /) -> Fit: ...


def depends_on_fit(etfe: Etfe) -> bool:
    """Whether the response of the loop is known beside a model only."""
    recording = etfe.recording
    return etfe.of_a_structure if recording is None else recording.sensed is not None


def as_of_the_loop(etfe: Etfe, fit: Fit) -> Etfe:
    """The response that a position sampled in the loop would have, whatever was sensed instead.

    Parameters
    ----------
    etfe : Etfe
        As it was measured; back as it is where it is that of a position beside a command.
    fit : Fit
        Of it, or of what an earlier fit made of it.
    """
    return _beside(etfe, fit.model.measured_system(fit.theta))


def _beside(etfe: Etfe, system: LinearSystem) -> Etfe:
    if not depends_on_fit(etfe):
        return etfe
    if etfe.recording is None:
        return etfe.beside_images(hidden_by_structure(system, etfe.frequency_hz, etfe.period_s))
    recording = with_images(etfe.recording, system)
    return replace(estimate_etfe(recording, etfe.band_hz), notices=etfe.notices)


def hardly_differ(etfe: Etfe, other: Etfe) -> bool:
    """Whether two estimates from one measurement differ by less than their errors.

    Through a reference the band is where that moves the force, which may end elsewhere each time.
    """
    if not np.array_equal(etfe.frequency_hz, other.frequency_hz):
        return False
    apart = np.abs(etfe.value - other.value) ** 2 / etfe.variance
    return bool(np.sum(apart) < _SAME)


def fitted_to_the_loop(fitting: Fitting, measured: Etfe, first: Etfe) -> tuple[Fit, Etfe]:
    """A model fitted to the response that it makes of the measurement.

    Parameters
    ----------
    fitting : callable
        Fits the model to a response.
    measured : Etfe
    first : Etfe
        What to begin with: `measured`, or what another model made of that.

    Returns
    -------
    fit : Fit
    etfe : Etfe
        What it was fitted to; `measured` itself where that depends on no model.
    """
    fit, etfe = fitting(first), first
    if not depends_on_fit(measured):
        return fit, etfe
    if fit.misfits:  # what is missing may have bent it into a valley where no device is
        nearer = _beside(measured, _motor_alone(measured, fit))
        other = fitting(nearer)
        if other.reduced_chi_square < fit.reduced_chi_square:
            fit, etfe = other, nearer
    fit, etfe = _settled(fitting, measured, fit, etfe)
    if fit.misfits:
        other = fitting(etfe)
        if other.reduced_chi_square < fit.reduced_chi_square * _AS_DEEP:
            fit, etfe = _settled(fitting, measured, other, etfe)
    return fit, etfe


def _motor_alone(etfe: Etfe, fit: Fit) -> LinearSystem:
    """The motor's mass, nearly all that moves between the samples, with the delay of a fit."""
    top = slice(-max(int(_TOP * len(etfe.value)), 1), None)
    omega = 2 * np.pi * etfe.frequency_hz[top]
    mass = float(np.median(1 / (np.abs(etfe.value[top]) * omega**2)))
    delay_s = fit.model.system(fit.theta).delay_s
    return LinearSystem(Mechanism((np.array([mass]),), ()), delay_s)


def _settled(fitting: Fitting, measured: Etfe, fit: Fit, etfe: Etfe) -> tuple[Fit, Etfe]:
    """The fit repeated from where the last one ended, until the response that it makes stays.

    A fit that does not settle is fitted once more when the loop is closed, and shows there as a
    misfit, so that no stiffness is recommended.
    """
    for _ in range(_MOST_ROUNDS):
        again = as_of_the_loop(measured, fit)
        if hardly_differ(again, etfe):
            break
        other = fitting(again, fit.theta)
        if other.reduced_chi_square > _RUNS_AWAY * max(fit.reduced_chi_square, 1.0):
            break
        fit, etfe = other, again
    return fit, etfe
