"""Does the response differ between parts of the recording?"""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.residual import Test, chi_square_score, hats
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows, remembered

_KNOTS = 6  # of the change over log frequency
SHAPES = {"a steady change": lambda t: t, "a change and back": lambda t: 1.5 * t**2 - 0.5}


def drift_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """Is the response to the force weighted with a shape over time other than none?

    If the response is G(f) (1 + delta(f) shape(t)), the position holds G delta times the transform
    of shape(t) u(t), beside what any constant response explains.  delta is complex and smooth over
    log frequency.
    """
    recording = etfe.unbroken
    if recording is None or etfe.period_lines is not None:
        return ()
    at_lines = Lines.of(etfe, recording)
    force = recording.force - recording.force.mean()
    time = np.linspace(-1, 1, recording.samples)
    response = remembered(fit.response)
    answers = response(at_lines.frequency_hz)
    tests = []
    for name, shape in SHAPES.items():
        column = answers * at_lines(force * shape(time))
        score, where = _smooth_score(etfe.spectra.windows(response, column[None]))
        text = f"{name} of the response during the recording ({score:.1f} standard deviations)"
        tests.append(Test(name, "time-varying", score, thresholds.normal(), where, text))
    return tuple(tests)


def _smooth_score(windows: Windows) -> tuple[float, float]:
    """Score of a complex coefficient of the last input that is smooth over log frequency."""
    nodes = windows.frequency_hz.shape[1]
    slope, found = windows.design[:, -1, -1], windows.target[:, -1]
    weight = np.sqrt(np.maximum(windows.lines - nodes - 2, 0.5) / windows.scatter)
    log_f = np.log10(windows.frequency_hz.mean(axis=1))
    knots = np.linspace(log_f[0], log_f[-1], _KNOTS)
    columns = (weight * slope)[:, None] * hats(log_f, knots)
    basis, sizes, _ = np.linalg.svd(columns, full_matrices=False)
    basis = basis[:, sizes > 1e-6 * sizes[0]]
    projection = basis.conj().T @ (weight * found)
    # A complex normal variable of unit variance: twice its square is chi-square with two.
    score = chi_square_score(2 * float(np.sum(np.abs(projection) ** 2)), 2 * basis.shape[1])
    strongest = int(np.argmax(np.abs(basis @ projection)))
    return score, float(10 ** log_f[strongest])
