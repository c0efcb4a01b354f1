"""Rows that a logger lost, put back where its time stamps say that they were."""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.signals.filling import Predictor, fill_both, fit_predictor
from bayeshaptic.types import Bools, Floats, Ints

# Relative, of the response: what forces that are read off the motion may bias it by.  With forces
# that are read off nothing a response of 20 s that lost a row in a hundred is 1.6e-3 off.
_BIAS = 3e-4


def put_back(
    force: Floats, position: Floats, reference: Floats | None, rows: Ints, where: str
) -> tuple[Floats, Floats, Floats | None]:
    """Force, position and reference with every row of an even clock.

    What is missing is what everything else leads to expect, the motion that follows included: it
    shows a lost force of a usual recording to a few per cent.  An expectation that knows the motion
    shares its noise, though, and makes the response too large by its error's share of the force's
    power.  Where that might be seen, behind a coarse encoder, what is missing of the force is what
    the force itself leads to expect, and what is missing of the position, what both do: the error
    of that has nothing to do with what is known, so that it is noise.  A straight line would be
    right half of the time, and bias the response to a white force by some three halves of the share
    that is missing.

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
    along = None if reference is None else np.interp(every, rows, reference)
    pushed, moved = np.interp(every, rows, force), np.interp(every, rows, position)
    own = _predictor(pushed, np.zeros(len(every)), missing, where)
    of_motion = _predictor(moved, pushed, missing, where)
    place, push, variance = fill_both(moved, pushed, missing, of_motion, own)
    if np.sum(variance) > _BIAS * np.sum(force**2):
        push = own.fill(pushed, np.zeros(len(every)), missing)
        place = of_motion.fill(moved, push, missing)
    push = np.clip(push, force.min(), force.max())  # it was commanded as the others were
    for signal in (push, place):
        signal.setflags(write=False)
    return push, place, along


def _predictor(signal: Floats, beside: Floats, missing: Bools, where: str) -> Predictor:
    found = fit_predictor(signal, beside, missing)
    if found is None:
        raise InputError(
            f"{where}: {int(missing.sum())} rows are missing by their time stamps, and "
            f"{int((~missing).sum())} are too few to say what stood there: record longer",
            topic="too-little",
        )
    return found
