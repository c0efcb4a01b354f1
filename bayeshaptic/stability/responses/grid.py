"""Where to look at a response so that no crossing slips between two points."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bayeshaptic.stability.responses.response import Response
from bayeshaptic.types import Floats

LOWEST = 1e-9  # radians a sample: 0.16 microhertz at T = 1 ms
# No point on the pole itself: an undamped one is infinite there.
_TANGENTS = np.tan(np.deg2rad(np.array([-88.0, -80, -60, -30, -8, 8, 30, 60, 80, 88])))


def in_chunks(batch: int) -> Iterator[slice]:
    """Rows of a batch of `batch` loops, some at a time: the arrays of a chunk stay in the cache."""
    chunk = 64
    return (slice(start, min(start + chunk, batch)) for start in range(0, batch, chunk))


def search_grid(response: Response, rows: slice) -> Floats:
    """Where to look at a response, loop by loop.

    A logarithmic grid from well below the slowest pole, points at equal steps of phase around each
    pole (w_p + |Re p| tan(angle)), and a linear grid fine enough for the phase of the delay.

    Parameters
    ----------
    response : Response
    rows : slice
        B of its loops.

    Returns
    -------
    ndarray, shape (B, L)
        Angles theta in (0, pi), ascending.
    """
    features = response.features[rows]
    delay = response.delay[rows]
    batch = len(delay)
    turns = (np.max(delay) + 1.5) / 2
    top = np.pi * (1 - 1e-7)  # a crossing nearer to the Nyquist frequency has its K to 1e-13
    per_turn = 16  # points for each turn of the delay's phase
    linear = np.linspace(0, top, int(np.ceil(per_turn * turns)) + 1)[1:]
    low = np.full((batch, 1), LOWEST)
    parts = [np.broadcast_to(linear, (batch, len(linear)))]
    if features.shape[1]:
        size = np.abs(features)
        slowest = np.where(size > 0, size, np.inf).min(axis=1, keepdims=True)
        low = np.clip(0.02 * slowest, LOWEST, 1e-3)
        # Conjugates see the same angles: the half with the largest imaginary parts is enough.
        order = np.argsort(-features.imag, axis=1)[:, : (features.shape[1] + 1) // 2]
        upper = np.take_along_axis(features, order, axis=1)
        sharpest = 1e-8  # relative half width around an undamped pole
        width = np.maximum(np.abs(upper.real), sharpest * np.abs(upper.imag))
        # A pole beyond the Nyquist frequency shows at its alias.
        angle = np.abs(upper.imag - 2 * np.pi * np.round(upper.imag / (2 * np.pi)))
        around = angle[:, :, None] + width[:, :, None] * _TANGENTS
        parts.append(np.clip(around.reshape(batch, -1), low, top))
    steps = np.linspace(0.0, 1.0, response.log_points)
    parts.append(low * np.exp(steps * np.log(top / low)))
    return np.sort(np.concatenate(parts, axis=1), axis=1)
