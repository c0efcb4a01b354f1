"""Is there a force that is not linear in a motion that repeats?  How strong may one be, unseen?

The columns are those of `bayeshaptic.diagnosis.residuals.columns`, averaged over the periods, and
ripples along the way.  A line has no neighbours that only noise moves, so what a force adds is
looked for beside what the model's parameters and any smooth change of the response can do.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.diagnosis.periodic.period import Period
from bayeshaptic.diagnosis.residuals.columns import ROUNDING, WEAK, columns, force_test
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.residual import (
    ForceSeen,
    Test,
    as_rows,
    beside_parameters,
    smooth_columns,
)
from bayeshaptic.diagnosis.residuals.ripples import (
    STEPS,
    WAVES,
    Ripple,
    Wave,
    place_of_action,
    rates_along,
    ripple_test,
)
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Complexes, Floats

# Most values of waves over a period, all rates together: 0.3 GB in between. For a period of 7,500
# samples that is all rates, for one of 30,000 those up to 25 periods along the way; for longer ones
# few rates are looked at.
_MOST_VALUES = 3_000_000


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

    def at_excited(signal: Floats) -> Complexes:
        return period.at_lines(period.transform(period.average(signal)))

    beside = _beside(fit)
    tests = []
    excited = Lines(fit.windows.frequency_hz[:, 0], at_excited)
    for name, inputs, rms in columns(fit, recording, excited):
        rows = as_rows(fit, inputs.T[:, None])
        left = beside.left_of(rows)
        instrument, column = left[:, 0], left[:, -1]
        size = float(np.linalg.norm(instrument))
        if size <= ROUNDING * float(np.linalg.norm(rows[:, 0])):
            continue
        along = float(instrument @ beside.residual) / size
        answers = max(float(instrument @ column) / size, WEAK * size)
        seen = ForceSeen(along / answers, beside.noise / answers, rms)
        tests.append(force_test(name, abs(along) / beside.noise, seen))
    tests += [
        ripple_test(wave, _ripple(wave, fit, etfe, period, beside), recording) for wave in WAVES
    ]
    return tuple(tests)


@dataclass(frozen=True)
class _Beside:
    """What is explained already, the residual, and its size, of which 1 is noise.

    `own` are orthonormal columns of what the parameters can do, `smooth` of anything else that is
    smooth over the frequency.
    """

    own: Floats = field(repr=False)
    smooth: Floats = field(repr=False)
    residual: Floats = field(repr=False)

    def left_of(self, rows: Floats) -> Floats:
        rows = rows - self.own @ (self.own.T @ rows)
        return np.asarray(rows - self.smooth @ (self.smooth.T @ rows))

    @property
    def noise(self) -> float:
        freedom = len(self.residual) - self.own.shape[1] - self.smooth.shape[1]
        left = float(np.linalg.norm(self.left_of(self.residual)))
        return max(1.0, left / np.sqrt(max(freedom, 1)))


def _beside(fit: Fit) -> _Beside:
    own, residual = beside_parameters(fit)
    return _Beside(own, smooth_columns(fit)[0], residual)


def _ripple(wave: Wave, fit: Fit, etfe: Etfe, period: Period, beside: _Beside) -> Ripple | None:
    """The ripple that stands out most of the lines."""
    recording = etfe.unbroken
    assert recording is not None
    place = period.average(place_of_action(fit, recording))
    rates = rates_along(place, recording)[: _MOST_VALUES // period.samples]
    if not len(rates):
        return None
    turned = np.outer(rates, place)
    times = wave.on(period.average(recording.force - recording.force.mean()))
    waves = times * np.stack([np.sin(turned), np.cos(turned)], axis=1)  # (R, 2, N)
    lines = period.at_lines(period.transform(waves.reshape(-1, period.samples)))
    response = fit.response(fit.windows.frequency_hz[:, 0])
    left = beside.left_of(as_rows(fit, (response * lines).T[:, None]))
    pairs = left.reshape(len(left), len(rates), 2)
    normal = np.einsum("nri,nrj->rij", pairs, pairs)
    normal += 1e-12 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(2)
    along = np.einsum("nri,n->ri", pairs, beside.residual)
    sizes = np.linalg.solve(normal, along[:, :, None])[:, :, 0]
    square = np.einsum("ri,ri->r", sizes, along) / beside.noise**2
    best = int(np.argmax(square))
    sd = beside.noise * float(np.sqrt(np.linalg.inv(normal[best]).diagonal().max()))
    log_chance = 0.5 * square[best] / np.log(10) - np.log10(len(rates) / STEPS)
    sine, cosine = sizes[best].tolist()
    return Ripple(float(rates[best]), sine, cosine, sd, max(float(log_chance), 0.0))
