"""The motion in a gap between two masses, corrected by the measured one, as an observer does.

Masses that rattle in a gap forget little: beside a motor that is 3e-4 too heavy the motion of a
held LHIfAM parts from the true one a dozen times in 30 s, for some tenths of a second each.  That
costs 1000 in log likelihood, and no fit arrives in a landscape of such steps.  So the motion that
the law is told is drawn a part of the way to the measured one, with which the landscape is smooth
(H. D. I. Abarbanel et al., SIAM Journal on Applied Dynamical Systems 8, 2009); what the force then
does is simulated without.  A spring that hardens forgets faster: with an observer its limit was
known up to twelve times less well.  Slow motion is not drawn: a hand moves all masses nearly alike,
and how far they are apart is too little to be measured, but known (`stretched`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from bayeshaptic.types import Floats

# Share of the way to the measured motion.  At the true parameters of that LHIfAM, noise around the
# resonance is 3 dB louder than the encoder's. With a share of 0.15, where motions part, it is 4.6
# dB louder; with 0.5, where the encoder's noise moves the masses, 3.6 dB.
_PART = 0.3
_SLOW_HZ = 10.0  # motion that is slower is not drawn


def correction(besides: Floats, period_s: float) -> Floats:
    """How far a motion between the motor and another mass is corrected, but for what forces do.

    Parameters
    ----------
    besides : ndarray, shape (N,)
        The motor's measured position less that of the command.
    period_s : float

    Returns
    -------
    ndarray, shape (N,)
        What forces add to the motor's position makes it less: `filtered`.
    """
    slow_hz = min(_SLOW_HZ, 0.4 / period_s)
    fast = butter(2, slow_hz, "high", fs=1 / period_s, output="sos")
    return np.asarray(_PART * sosfilt(fast, besides, zi=besides[0] * sosfilt_zi(fast))[0])


def stretched(slow: Floats, period_s: float, values: Mapping[str, float]) -> Floats:
    """How far the motor hangs back in its connection, where a hand moves the device.

    Some thousandths of a newton; but they push the masses to one side of a gap, and a cubic spring
    at the motor stood 9 and 15 standard deviations out beside two gaps where they were left out.

    Parameters
    ----------
    slow : ndarray, shape (N,)
        The hand's part of the motor's position.
    period_s : float
    values : mapping
        The linear parameters, by name.
    """
    velocity = np.gradient(slow, period_s)
    push = values["m1"] * np.gradient(velocity, period_s) + values["b1"] * velocity
    return np.asarray(-push / values["kc"])


def filtered(matrix: Floats, reading: Floats) -> tuple[Floats, Floats, Floats]:
    """State equations with the filter of `correction` behind the motor's position.

    Parameters
    ----------
    matrix : ndarray, shape (S, S)
    reading : ndarray, shape (S,)
        The motor's position in the states.

    Returns
    -------
    matrix : ndarray, shape (S + 2, S + 2)
        The last two states are a low-passed position and its derivative.
    reading : ndarray, shape (S + 2,)
    corrected : ndarray, shape (S + 2,)
        What `correction` makes of that position.
    """
    w, damping = 2 * np.pi * _SLOW_HZ, np.sqrt(2)  # Butterworth's filter
    own, reading = len(matrix), np.append(reading, [0.0, 0.0])
    longer = np.pad(matrix, (0, 2))
    longer[own, own + 1] = 1.0
    longer[own + 1] = w**2 * reading
    longer[own + 1, own:] = -(w**2), -damping * w
    fast = reading.copy()
    fast[own:] = -1.0, -damping / w
    return longer, reading, _PART * fast
