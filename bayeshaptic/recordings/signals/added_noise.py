r"""What of a command neither its own past nor the motion up to then foretells: its innovations.

Whatever a controller makes of the motion it makes of what it has read.  So what is left of the
command when its own past and the positions up to then have said all that is linear in them,

.. math:: r_k = u_k - \sum_{i \ge 1} a_i u_{k-i} - \sum_{i \ge 0} b_i y_{k-i},

owes nothing to the noise of the position: to that before, because what the noise was is in those
sums (y - G u), to that after, because it had not come yet.  It is an instrument through which the
device can be read (T. Soederstroem and P. Stoica, "System Identification", Prentice Hall, 1989,
chapter 8), where somebody added a noise of his own to the command, known or not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

_LAGS = 20  # of command and position: a controller with its filters, and a few modes
_AT_ONCE = 20_000  # samples: an hour of them is large
# Least size of innovations that count, over the command's standard deviation. Less is what encoder
# and logger make of a law of the motion, or the little that the past of a smooth reference leaves
# open.  Of 96 loops to whose command nothing was added, 25 leave more: all have references that
# step, and a step is new.
_LEAST = 0.1


def command_innovations(recording: Recording) -> Floats | None:
    """The innovations of the command, shape (N,); None where they are next to nothing of it.

    Parameters
    ----------
    recording : Recording
        One law holds in all of its pieces.
    """
    triangle = np.zeros((0, 2 * _LAGS + 3))
    for _, rows in _rows(recording):
        triangle = np.asarray(np.linalg.qr(np.concatenate([triangle, rows]), mode="r"))
    if len(triangle) < triangle.shape[1]:
        return None
    size = np.linalg.norm(triangle[:, :-1], axis=0)
    size[size == 0] = 1.0
    law = np.linalg.lstsq(triangle[:, :-1] / size, triangle[:, -1], rcond=1e-10)[0] / size
    found = np.zeros(recording.samples)
    for first, rows in _rows(recording):
        found[first : first + len(rows)] = rows[:, -1] - rows[:, :-1] @ law
    return found if np.std(found) > _LEAST * np.std(recording.force) else None


def _rows(recording: Recording) -> Iterator[tuple[int, Floats]]:
    """From which sample on, what may foretell the command, and the command, (n, 2 `_LAGS` + 3)."""
    start = 0
    for piece in recording.pieces:
        force, position = (signal - signal.mean() for signal in (piece.force, piece.position))
        # Differences say what positions at neighbouring samples do, which are nearly alike.
        rate = np.diff(position, prepend=position[0])
        change = np.diff(rate, prepend=0.0)
        for first in range(_LAGS, piece.samples, _AT_ONCE):
            at = np.arange(first, min(first + _AT_ONCE, piece.samples))
            columns = [force[at - lag] for lag in range(1, _LAGS + 1)]
            columns += [position[at], rate[at], *(change[at - lag] for lag in range(_LAGS))]
            yield start + first, np.stack([*columns, force[at]], axis=1)
        start += piece.samples
