"""Does the response differ between parts of the recording?"""

from __future__ import annotations

import numpy as np
from scipy.stats import f as f_distribution

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.columns import line_transform
from bayeshaptic.diagnosis.residuals.residual import Test, chi_square_score
from bayeshaptic.errors import InputError
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe, estimate_etfe
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.recordings.signals.excitation import find_repetition

CHANGE = "a change between the periods"
_KNOTS = 6
_SHAPES = {"a steady change": lambda t: t, "a change and back": lambda t: 1.5 * t**2 - 0.5}


def drift_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """Is the response to the force weighted with a shape over time other than none?

    If the response is G(f) (1 + delta(f) shape(t)), the position holds G delta times the transform
    of shape(t) u(t), beside what any constant response explains.  delta is complex and smooth over
    log frequency.
    """
    recording = etfe.unbroken
    if recording is None or etfe.period_lines is not None:
        return ()
    at_lines = line_transform(etfe, recording)
    force = recording.force - recording.force.mean()
    time = np.linspace(-1, 1, recording.samples)
    response = fit.response(etfe.spectra.frequency_hz)  # type: ignore[attr-defined]
    tests = []
    for name, shape in _SHAPES.items():
        column = response * at_lines(force * shape(time))
        score, where = _smooth_score(etfe.spectra.windows(fit.response, column[None]))
        text = f"{name} of the response during the recording ({score:.1f} standard deviations)"
        tests.append(Test(name, "time-varying", score, thresholds.normal(), where, text))
    return tuple(tests)


def halves_test(etfe: Etfe) -> tuple[Test, ...]:
    """Is the response to a force that repeats another in the last periods than in the first?

    Each half has its own noise, so that a line's difference over its variance is of Fisher's F
    distribution; the lines' chances are combined as Fisher's. None where a half has not two whole
    periods. Of thirteen recordings in which nothing changes none scores above 1.1; a gain or a grip
    that drifts as the bench's do scores 30 to 110.
    """
    recording, spectra = etfe.unbroken, etfe.spectra
    repetition = None if recording is None else find_repetition(recording.force)
    if recording is None or repetition is None or not isinstance(spectra, PeriodicSpectra):
        return ()
    stop = min(repetition.stop + 1, recording.samples)
    half = spectra.periods // 2 * repetition.period
    first = stop - spectra.periods * repetition.period
    try:
        before, after = (
            estimate_etfe(recording.part(a, a + half), etfe.band_hz, minimum_lines=12)
            for a in (first, stop - half)
        )
    except InputError:
        return ()
    early, late = before.spectra, after.spectra
    if not (isinstance(early, PeriodicSpectra) and isinstance(late, PeriodicSpectra)):
        return ()
    _, i, j = np.intersect1d(
        np.rint(early.frequency_hz * repetition.period * recording.period_s),
        np.rint(late.frequency_hz * repetition.period * recording.period_s),
        return_indices=True,
    )
    apart = np.abs(before.value[i] - after.value[j]) ** 2 / (before.variance[i] + after.variance[j])
    freedom = 2 * (early.freedom[i] + late.freedom[j] - 2)
    chances = f_distribution.logsf(apart, 2, freedom)
    score = chi_square_score(-2 * float(np.sum(chances)), 2 * len(apart))
    text = f"the last periods differ from the first ({score:.1f} standard deviations)"
    where = float(early.frequency_hz[i][np.argmin(chances)])
    return (Test(CHANGE, "time-varying", score, thresholds.normal(), where, text),)


def _smooth_score(windows: Windows) -> tuple[float, float]:
    """Score of a complex coefficient of the last input that is smooth over log frequency."""
    nodes = windows.frequency_hz.shape[1]
    slope, found = windows.design[:, -1, -1], windows.target[:, -1]
    weight = np.sqrt(np.maximum(windows.lines - nodes - 2, 0.5) / windows.scatter)
    log_f = np.log10(windows.frequency_hz.mean(axis=1))
    knots = np.linspace(log_f[0], log_f[-1], _KNOTS)
    hats = np.stack([np.interp(log_f, knots, row) for row in np.eye(_KNOTS)], axis=-1)
    basis, sizes, _ = np.linalg.svd((weight * slope)[:, None] * hats, full_matrices=False)
    basis = basis[:, sizes > 1e-6 * sizes[0]]
    projection = basis.conj().T @ (weight * found)
    # A complex normal variable of unit variance: twice its square is chi-square with two.
    score = chi_square_score(2 * float(np.sum(np.abs(projection) ** 2)), 2 * basis.shape[1])
    strongest = int(np.argmax(np.abs(basis @ projection)))
    return score, float(10 ** log_f[strongest])
