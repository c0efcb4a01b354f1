"""Rows of a buffer that was written a second time, each of which is read once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.types import Floats, Ints


def rows_read_once(
    time_s: Floats, signals: Sequence[Floats]
) -> tuple[Ints | slice, tuple[Notice, ...]]:
    """The rows without those that repeat earlier ones, and a note that says so.

    Their time runs back to that of rows before them, which they repeat in every signal. Two rows of
    one time that stand one behind the other are left alone: stamps may be coarse, and signals held.

    Parameters
    ----------
    time_s : ndarray, shape (N,)
    signals : sequence of ndarray, shape (N,)

    Returns
    -------
    tuple of (ndarray of int or slice, tuple of Notice)
        Every row and no note where time runs back for another reason, or not at all.
    """
    steps = np.diff(time_s)
    every = slice(None), ()
    if not np.any(steps < 0) or np.any(steps == 0):
        return every
    rows, at = np.unique(np.stack([time_s, *signals], axis=1), axis=0, return_index=True)
    left = len(time_s) - len(at)
    if left == 0 or np.any(np.diff(at) < 0) or np.any(np.diff(rows[:, 0]) == 0):
        return every
    first = int(np.setdiff1d(np.arange(len(time_s)), at)[0]) + 1
    text = (
        f"{left} rows repeat others that stand before them, their times too, as where a buffer is "
        f"written twice; the first is row {first}. Each was read once."
    )
    return at, (Notice("note", "time stamps", text),)
