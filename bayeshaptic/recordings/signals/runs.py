"""Runs of true values."""

from __future__ import annotations

import numpy as np

from bayeshaptic.types import Bools, Ints


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
