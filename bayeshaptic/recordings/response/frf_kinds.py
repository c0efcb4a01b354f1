"""What a table's response is of: the sampled loop, or a continuous structure.

A loop's own response, from command to position, has the hold in it. The receptance, mobility and
accelerance of a structure, position, velocity and acceleration over a force that was measured with
a hammer or a shaker (D. J. Ewins, *Modal Testing*, 2000), have none.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.recordings.signals.other_outputs import NO_LOOP
from bayeshaptic.types import Complexes, Floats

# Time derivatives of the position in each.
STRUCTURAL = {"receptance_db": 0, "mobility_db": 1, "accelerance_db": 2}
PER_TIME = {0: ("",), 1: ("/s",), 2: ("/s^2", "/s2", "/s/s")}


def of_a_hold(frequency_hz: Floats, period_s: float) -> Complexes:
    r"""What holding a command for a period does to it: :math:`(1 - e^{-sT}) / (sT)`, shape (L,)."""
    s = 2j * np.pi * frequency_hz * period_s
    return np.asarray(-np.expm1(-s) / s)


def as_held(
    value: Complexes, variance: Floats, frequency_hz: Floats, period_s: float, derivatives: int
) -> tuple[Complexes, Floats]:
    """The receptance under a command that is held for a period, from a structure's response.

    Without the images of what lies above half the sampling rate, which a table does not show: a
    model that is fitted to it knows them (`bayeshaptic.models.response.between_samples`).

    Parameters
    ----------
    value : complex ndarray, shape (L,)
    variance : ndarray, shape (L,)
    frequency_hz : ndarray, shape (L,)
    period_s : float
    derivatives : int
        0 for receptance, 1 for mobility, 2 for accelerance.

    Returns
    -------
    value, variance
    """
    turn = of_a_hold(frequency_hz, period_s) / (2j * np.pi * frequency_hz) ** derivatives
    return value * turn, variance * np.abs(turn) ** 2


def with_images_allowed_for(
    value: Complexes, variance: Floats, frequency_hz: Floats, period_s: float
) -> Floats:
    r"""The variance where no model says what the images are.

    Of a response that falls as :math:`1/\omega^2` the nearest is :math:`(f / (f_s - f))^3` of it:
    that much is added to the standard deviation.
    """
    part = frequency_hz * period_s
    return np.asarray(variance + np.abs(value * (part / (1 - part)) ** 3) ** 2)


def told(kind: str) -> Notice:
    """What was done to a structure's response."""
    text = (
        f"The table is the {kind.removesuffix('_db')} of a continuous structure: it was turned "
        "into the response of a loop that holds its command for a period, with what a fitted model "
        "says of the frequencies above half the sampling rate."
    )
    return Notice("note", NO_LOOP, text)
