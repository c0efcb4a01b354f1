"""Where a fit of one mass begins."""

from __future__ import annotations

from functools import partial

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.numerics.low_pass import low_pass
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats


def by_inverse_dynamics(recording: Recording) -> Floats:
    """Where to begin, shape (5,): least squares of the force on the filtered motion."""
    period_s, band = recording.period_s, 0.025  # of the sampling rate
    slow = partial(low_pass, edge_hz=band, period_s=1.0)  # in samples
    speeds = [np.gradient(slow(piece.position), period_s) for piece in recording.pieces]
    usual = float(np.std(np.concatenate(speeds)))
    if not usual > 0:
        raise InputError(f"{recording.name}: nothing moves in it")
    columns, target = [], []
    for piece, v in zip(recording.pieces, speeds, strict=True):
        sign = slow(np.tanh(v / (0.02 * usual)))
        # At its ends the filter takes a motion that goes on for one that stops.
        edge = min(round(2 / band), len(v) // 8)
        inside = slice(edge, len(v) - edge)
        design = np.stack([np.gradient(v, period_s), v, sign, np.ones_like(v)], 1)
        columns.append(design[inside])
        target.append(slow(piece.force)[inside])
    design = np.concatenate(columns)
    mass, damping, dry, offset = np.linalg.lstsq(design, np.concatenate(target), rcond=None)[0]
    if not mass > 0:
        mass = np.std(recording.force) / np.std(design[:, 0])
    start = [mass, max(damping, 0.01 * mass), max(dry, 0.0), offset, 0.5 * period_s]
    return np.array(start, dtype=np.float64)
