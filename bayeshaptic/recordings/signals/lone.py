"""Single samples that lie far from those beside them: bits that flipped, pulses missed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.filling import fit_predictor
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Bools, Floats

FARTHER = 8.0  # than any sample around them, and than a count
AROUND = 10  # samples on either side
_ALONE = 1.5  # times as far as the two beside it, which are off by half: after a jump one is as far


def lone(position: Floats) -> Bools:
    """Samples eight times as far from the middle of both neighbours as any of the eighteen around.

    A device that is struck goes on as it was pushed, a position that jumps stays where it is then,
    and a resting encoder flickers by one count.

    Parameters
    ----------
    position : ndarray, shape (N,)

    Returns
    -------
    ndarray of bool, shape (N,)
    """
    from scipy.ndimage import maximum_filter1d

    off = np.zeros(len(position))
    off[1:-1] = np.abs(position[1:-1] - 0.5 * (position[:-2] + position[2:]))
    # Half of what one sample is off is what both beside it are.
    apart = 1 + AROUND // 2
    beside = maximum_filter1d(np.pad(off, apart), AROUND - 1)
    found: Bools = off > FARTHER * np.maximum(beside[: -2 * apart], beside[2 * apart :])
    found[1:-1] &= off[1:-1] > _ALONE * np.maximum(off[:-2], off[2:])
    found[:2] = found[-2:] = False  # of the first and the last one cannot be told
    if found.any():
        found &= off > FARTHER * (increment_unit(position) or 0.0)
    return found


def without_lone(recording: Recording) -> Recording:
    """The recording with what all other samples and the force predict in the place of such ones."""
    wild = lone(recording.position)
    predictor = fit_predictor(recording.position, recording.force, wild) if wild.any() else None
    if predictor is None:
        return recording
    return replace(recording, position=predictor.fill(recording.position, recording.force, wild))
