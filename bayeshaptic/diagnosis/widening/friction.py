"""How much of a model's damping may be friction, judged by the noise that friction makes.

The sign of a normally distributed velocity has a part that is proportional to the velocity, sqrt(2
/ pi) over its rms, which looks like a damper; the rest is noise.  So a device with little noise has
little friction.  Where noise is left and no law of a force was found, as much of the damping as
would make this noise may be friction.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from bayeshaptic.diagnosis.residuals.excess import changing_share
from bayeshaptic.diagnosis.traced import Traced
from bayeshaptic.effects.nonlinear.shapes import EXCESS_NOISE
from bayeshaptic.inference.fit import Fit
from bayeshaptic.models.structures import GROUND_DAMPERS
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.raw_signals import count_of
from bayeshaptic.types import Floats

# Share of the response that changes, in the slowest octave: 0.35 to 2.5 in eleven recordings
# with friction of 0.6 to 1.3 of the rms force, about the square of that. Of less than a tenth of it
# tests of a force speak.
_HELD_BY_FRICTION = 0.02
_VISCOUS = 0.2  # of the damping, if most of it is friction that was fitted as damping


def may_be_held_by_friction(fit: Fit, traced: Traced) -> bool:
    """Whether noise alone is left of a force, as friction leaves it that mostly holds a mass.

    Parameters
    ----------
    fit : Fit
    traced : Traced
    """
    left = {test.name for test in traced.after if test.flagged and test.family == "nonlinear"}
    return left == {EXCESS_NOISE} and changing_share(fit, traced.state.etfe) > _HELD_BY_FRICTION


def with_friction_for_damping(
    fit: Fit, etfe: Etfe | None = None, dampers: Collection[str] = GROUND_DAMPERS
) -> Floats:
    """The fitted parameters, shape (P,), with only that part of the damping that must be viscous.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe, optional
        By whose noise friction is bounded; without one most of the damping may be friction.
    dampers : collection of str
        Which may be friction: those to the ground, or the connection's.
    """
    damped = np.array([name in dampers for name in fit.model.names])
    least = _VISCOUS
    if etfe is not None:
        least = max(least, 1.0 - _as_damper(fit, etfe) / max(fit.theta[damped].sum(), 1e-300))
    return np.where(damped, least * fit.theta, fit.theta)


def _as_damper(fit: Fit, etfe: Etfe) -> float:
    """The damper that friction looks like which would make all of the device's noise."""
    recording = etfe.unbroken
    if recording is None:
        return np.inf
    steps = np.diff(recording.position)
    # The difference of two rounded numbers.
    moved = float(np.var(steps)) - count_of(recording) ** 2 / 6
    if not moved > 0:
        return np.inf
    friction = float(np.sqrt(changing_share(fit, etfe))) * float(np.std(recording.force))
    return float(np.sqrt(2 / np.pi)) * friction * recording.period_s / float(np.sqrt(moved))
