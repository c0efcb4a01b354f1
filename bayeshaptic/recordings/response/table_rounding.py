"""What a table's digits leave open: analysers write a few, and less noise than that is none."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Floats

_DIGITS = 8  # after the point; what has more was not rounded to a grid


def written_step(values: Floats) -> float:
    """The last digit that numbers were written to: 0.01 of -3.25 and 7.1.

    Parameters
    ----------
    values : ndarray, shape (L,)

    Returns
    -------
    float
        Zero where they have more than eight digits after the point.
    """
    for digits in range(_DIGITS + 1):
        scaled = values * 10.0**digits
        if np.all(np.abs(scaled - np.round(scaled)) <= 1e-6):
            return float(10.0**-digits)
    return 0.0


def relative_variance(gain_db: Floats, phase_deg: Floats) -> float:
    """Variance that rounding gain and phase gives the response, over its square.

    Parameters
    ----------
    gain_db : ndarray, shape (L,)
    phase_deg : ndarray, shape (L,)

    Returns
    -------
    float
    """
    of_gain = np.log(10) / 20 * written_step(gain_db)
    of_phase = np.radians(written_step(phase_deg))
    return float((of_gain**2 + of_phase**2) / 12)


def within_half_a_digit(coherence: Floats) -> Floats:
    """Coherence, where it was rounded to 0 or 1 half of the last digit inside.

    Parameters
    ----------
    coherence : ndarray, shape (L,)

    Returns
    -------
    ndarray, shape (L,)
        As it was where all of it is 0 or 1, which is no coherence that anybody measured.
    """
    inside = coherence[(coherence > 0) & (coherence < 1)]
    half = written_step(inside) / 2 if len(inside) else 0.0
    rounded = (coherence == 0) | (coherence == 1)
    return np.where(rounded, np.clip(coherence, half, 1 - half), coherence)
