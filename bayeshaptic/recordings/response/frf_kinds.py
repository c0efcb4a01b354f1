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

SAMPLED = "gain_db"
# Time derivatives of the position in each.
STRUCTURAL = {"receptance_db": 0, "mobility_db": 1, "accelerance_db": 2}
PER_TIME = {0: ("",), 1: ("/s",), 2: ("/s^2", "/s2", "/s/s")}


def as_sampled(
    value: Complexes, variance: Floats, frequency_hz: Floats, period_s: float, derivatives: int
) -> tuple[Complexes, Floats]:
    r"""The response of a loop that holds its command for a period, from that of a structure.

    .. math:: G(j\omega) \frac{1 - e^{-j \omega T}}{j \omega T}

    without the aliases, which a table does not say.  Of a response that falls as :math:`1/\omega^2`
    the nearest is :math:`(f / (f_s - f))^3` of it: that much is added to the standard deviation.

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
    s = 2j * np.pi * frequency_hz
    turn = -np.expm1(-s * period_s) / (s * period_s) / s**derivatives
    part = frequency_hz * period_s
    aliases = (part / (1 - part)) ** 3
    held = value * turn
    return held, variance * np.abs(turn) ** 2 + np.abs(held * aliases) ** 2


def told(kind: str) -> Notice:
    """What was done to a structure's response."""
    text = (
        f"The table is the {kind.removesuffix('_db')} of a continuous structure: it was turned "
        "into the response of a loop that holds its command for a period."
    )
    return Notice("note", NO_LOOP, text)
