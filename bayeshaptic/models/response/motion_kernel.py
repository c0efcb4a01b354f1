"""Sums over poles in time, compiled."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Complexes, Floats


@kernel
def modal_motion(
    force: Floats,
    substeps: int,
    whole: int,
    decay: Complexes,
    new: Complexes,
    old: Complexes,
    weights: Complexes,
) -> Floats:
    """Rows of weighted sums over modes that a held force drives, from rest.

    Parameters
    ----------
    force : ndarray, shape (N,)
        Held over a period of `substeps` steps, and `whole` steps late.
    decay : complex ndarray, shape (P,)
        What is left of a mode after a step.
    new, old : complex ndarray, shape (P,)
        What a force gives a mode in a step, and the force of the step before.
    weights : complex ndarray, shape (R, P)

    Returns
    -------
    ndarray, shape (R, N * substeps)
        Real parts.
    """
    motion = np.zeros((len(weights), len(force) * substeps))
    for mode in range(len(decay)):
        state, before = 0j, 0.0
        for k in range(motion.shape[1]):
            for row in range(len(weights)):
                motion[row, k] += (weights[row, mode] * state).real
            held = force[(k - whole) // substeps] if k >= whole else 0.0
            state = state * decay[mode] + (new[mode] * held + old[mode] * before)
            before = held
    return motion
