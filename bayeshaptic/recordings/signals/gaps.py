"""Rows that a logger lost, put back where its time stamps say that they were."""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.signals.filling import fit_predictor
from bayeshaptic.types import Floats, Ints


def put_back(
    force: Floats, position: Floats, reference: Floats | None, rows: Ints, where: str
) -> tuple[Floats, Floats, Floats | None]:
    """Force, position and reference with every row of an even clock.

    What is missing of the force is what the force itself leads to expect, and what is missing of
    the position, what both do: the error of such an expectation has nothing to do with what is
    known, so that it is noise.  A straight line would be right half of the time, and bias the
    response to a white force by some three halves of the share that is missing.

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    reference : ndarray, shape (N,), or None
    rows : ndarray of int, shape (N,)
        The place of each sample on the clock, from zero on.
    where : str
        Beginning of the message.

    Raises
    ------
    InputError
        Where there are too few samples to expect anything from.
    """
    every = np.arange(int(rows[-1]) + 1)
    missing = np.ones(len(every), dtype=bool)
    missing[rows] = False

    def filled(signal: Floats, beside: Floats) -> Floats:
        line = np.interp(every, rows, signal)
        predictor = fit_predictor(line, beside, missing)
        if predictor is None:
            raise InputError(
                f"{where}: {int(missing.sum())} rows are missing by their time stamps, and "
                f"{len(rows)} are too few to say what stood there: record longer",
                topic="too-little",
            )
        whole = predictor.fill(line, beside, missing)
        whole.setflags(write=False)
        return whole

    whole = filled(force, np.zeros(len(every)))
    along = None if reference is None else np.interp(every, rows, reference)
    return whole, filled(position, whole), along
