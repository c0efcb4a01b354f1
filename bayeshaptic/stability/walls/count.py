"""How many closed-loop poles are outside the unit circle, by the boundaries that lie between."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.stability.walls.curve import Events, KbCurve, along_damping
from bayeshaptic.types import Floats, Ints


def pairs_of(stiffness: ArrayLike, damping: ArrayLike) -> tuple[Floats, Floats]:
    """Stiffnesses and dampings that broadcast against each other, as arrays of one shape.

    Raises
    ------
    InputError
        Where their shapes do not go together.
    """
    k, b = np.asarray(stiffness, float), np.asarray(damping, float)
    try:
        k, b = np.broadcast_arrays(k, b)
    except ValueError:
        raise InputError(
            f"stiffness has the shape {k.shape} and damping {b.shape}, which do not go together; "
            "give as many of one as of the other, or stiffness[:, None] for every pair"
        ) from None
    return k, b


def unstable_at_start(curve: KbCurve, start: Floats, levels: Floats) -> Ints:
    """How many poles are outside the unit circle where lines of constant damping begin.

    Parameters
    ----------
    curve : KbCurve
        The boundaries of n loops.
    start : ndarray, shape (n,)
        A stiffness at which each loop is stable without damping; nan for a loop that never is.
    levels : ndarray, shape (J,)
        Dampings.

    Returns
    -------
    ndarray of int, shape (n, J)
        At the stiffness `start` and each damping.  A loop that is never stable is said to have a
        thousand.
    """
    events = along_damping(curve, np.where(np.isnan(start), 1.0, start))
    poles = np.zeros((len(start), len(levels)), int)
    for number, level in enumerate(levels):
        between = (events.place > min(level, 0)) & (events.place < max(level, 0))
        change = np.bincount(events.row[between], events.poles[between], len(start))
        poles[:, number] = np.sign(level) * np.rint(change)
    many = 1000  # poles outside, of a loop that is never stable
    poles[np.isnan(start)] = many
    return poles


def beyond_start(
    events: Events, rows: Ints, heights: Floats, levels: int, start: Floats
) -> NDArray[np.int_]:
    """How many more poles are outside the unit circle than where the lines begin.

    Parameters
    ----------
    events : Events
        Where boundaries meet the lines.
    rows : ndarray of int, shape (m,)
        Neighbouring loops to count for.
    heights : ndarray, shape (I,)
        Stiffnesses, ascending.
    levels : int
        Number J of lines of constant damping.
    start : ndarray, shape (n,)
        The stiffness at which the lines of each of the n loops begin.

    Returns
    -------
    ndarray of int, shape (m, J, I)
    """
    mine = (events.row >= rows[0]) & (events.row <= rows[-1])
    row, level = events.row[mine] - rows[0], events.level[mine]
    place, poles = events.place[mine], events.poles[mine]
    reach = len(heights) + 1
    cell = (row * levels + level) * reach + np.searchsorted(heights, place)
    total = np.bincount(cell, poles, len(rows) * levels * reach)
    passed = np.cumsum(total.reshape(len(rows), levels, reach), axis=2)[:, :, :-1]
    below = place < np.nan_to_num(start)[rows][row]
    first = np.bincount((row * levels + level)[below], poles[below], len(rows) * levels)
    return np.rint(passed - first.reshape(len(rows), levels, 1)).astype(int)
