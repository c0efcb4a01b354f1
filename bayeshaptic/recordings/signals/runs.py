"""Runs of true values, and of rows that are alike."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bayeshaptic.types import Bools, Floats, Ints


def runs(flags: Bools) -> tuple[Ints, Ints]:
    """First index of each run, and the one behind its last; shape (R,) each.

    Parameters
    ----------
    flags : ndarray of bool, shape (N,)
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    return edges[::2], edges[1::2]


def longest(flags: Bools) -> tuple[int, int]:
    """The same of the longest run, the first of equal ones; (0, 0) where there is none.

    Parameters
    ----------
    flags : ndarray of bool, shape (N,)
    """
    starts, stops = runs(flags)
    if len(starts) == 0:
        return 0, 0
    most = int(np.argmax(stops - starts))
    return int(starts[most]), int(stops[most])


def written_each(signals: Sequence[Floats]) -> tuple[int, int]:
    """How often each row is written, as where a log is faster than its loop; and the first new row.

    Every signal changes at every n-th row alone, a hundred times at least: none of 200 simulated
    open and closed loops does.

    Parameters
    ----------
    signals : sequence of ndarray, shape (N,)

    Returns
    -------
    tuple of int
        (1, 0) where rows differ.
    """
    changes = [1 + np.flatnonzero(np.diff(signal)) for signal in signals]
    fewest = 100
    if min(len(at) for at in changes) < fewest:
        return 1, 0
    most = 20  # times
    for often in range(most, 1, -1):
        first = int(changes[0][0] % often)
        if all(np.all(at % often == first) for at in changes):
            return often, first
    return 1, 0
