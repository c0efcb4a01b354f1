"""Modes in time, compiled."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Complexes, Floats


@kernel
def driven_modes(force: Floats, decay: Complexes, new: Complexes, old: Complexes) -> Floats:
    """Modes that a held force drives, from rest, at the start of each of its periods.

    Parameters
    ----------
    force : ndarray, shape (N,)
    decay : complex ndarray, shape (P,)
        What is left of a mode after a period.
    new, old : complex ndarray, shape (P,)
        What the force gives a mode in a period, and the force of the period before.

    Returns
    -------
    ndarray, shape (N, 2 P + 2)
        Real parts, imaginary parts, the force and that before.
    """
    modes = len(decay)
    found = np.empty((len(force), 2 * modes + 2))
    state = np.zeros(modes, np.complex128)
    before = 0.0
    for k in range(len(force)):
        for mode in range(modes):
            found[k, mode] = state[mode].real
            found[k, modes + mode] = state[mode].imag
            driven = new[mode] * force[k] + old[mode] * before
            state[mode] = state[mode] * decay[mode] + driven
        found[k, 2 * modes], found[k, 2 * modes + 1] = force[k], before
        before = force[k]
    return found
