"""Is there a force that is not linear in a motion that repeats?  How strong may one be, unseen?

The columns are those of `bayeshaptic.diagnosis.residuals.columns`, averaged over the periods.  A
line has no neighbours that only noise moves, so what a force adds is looked for beside what the
model's parameters and any smooth change of the response can do.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis.periodic.period import Period
from bayeshaptic.diagnosis.residuals.columns import ROUNDING, WEAK, columns, force_test
from bayeshaptic.diagnosis.residuals.residual import (
    ForceSeen,
    Test,
    as_rows,
    beside_parameters,
    smooth_columns,
)
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Complexes, Floats


def force_tests(fit: Fit, etfe: Etfe, period: Period) -> tuple[Test, ...]:
    """One test for each nonlinear function of command and motion.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        Periodic; what accepted forces add is taken off.
    period : Period
    """
    recording = etfe.unbroken
    assert recording is not None
    frequency_hz = fit.windows.frequency_hz[:, 0]

    def at_lines(signal: Floats) -> Complexes:
        return period.at_lines(period.transform(period.average(signal)))

    own, residual = beside_parameters(fit)
    smooth = smooth_columns(fit)[0]
    freedom = len(residual) - own.shape[1] - smooth.shape[1]

    def left_of(rows: Floats) -> Floats:
        rows = rows - own @ (own.T @ rows)
        return np.asarray(rows - smooth @ (smooth.T @ rows))

    noise = max(1.0, float(np.linalg.norm(left_of(residual))) / np.sqrt(max(freedom, 1)))
    tests = []
    for name, (inputs, rms) in columns(fit, recording, frequency_hz, at_lines).items():
        rows = as_rows(fit, inputs.T[:, None])
        left = left_of(rows)
        instrument, column = left[:, 0], left[:, -1]
        size = float(np.linalg.norm(instrument))
        if size <= ROUNDING * float(np.linalg.norm(rows[:, 0])):
            continue
        along = float(instrument @ residual) / size
        answers = max(float(instrument @ column) / size, WEAK * size)
        seen = ForceSeen(along / answers, noise / answers, rms)
        tests.append(force_test(name, abs(along) / noise, seen))
    return tuple(tests)
