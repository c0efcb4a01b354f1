"""A Kalman filter beside the simulated motion of a mass, in compiled passes over the samples."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats, Ints

_CERTAIN = 8.0  # standard deviations of a velocity, beyond which its sign is certain
# Samples of its full force, that friction may let go of a mass earlier or later. With 1 and with 15
# widths and coverage of 100 loops are the same to two digits.
_LET_GO = 5.0
_BEGINS = 3  # samples in which the command of before the recording arrives


@kernel
def gains_of(
    motion: Floats,
    push: Floats,
    sizes: Floats,
    velocity: Floats,
    resting: NDArray[np.bool_],
    starts: Ints,
) -> tuple[Floats, Floats]:
    """The filter's gains, shape (N, 2), and its innovations' variances, shape (N,).

    A mass that friction holds is no linear filter's: variances are infinite there, and where it
    begins to move the filter begins anew, with the position as measured and little velocity.

    Parameters
    ----------
    motion : ndarray, shape (2, 2)
        Position and velocity a sample later, without a force.
    push : ndarray, shape (2,)
        What a unit force, held for a sample, does to them.
    sizes : ndarray, shape (4,)
        Standard deviations of the white force and of a measured position, size of the dry friction,
        standard deviation of the velocity where a piece begins.
    velocity : ndarray, shape (N,)
        Simulated.
    resting : ndarray of bool, shape (N,)
    starts : ndarray of int, shape (J,)
        Where the pieces begin.
    """
    force_sd, position_sd, dry, unknown = sizes
    gains, variances = np.empty((len(velocity), 2)), np.empty(len(velocity))
    far, kept = motion[0, 1], motion[1, 1]
    xx = xv = vv = 0.0  # the state's covariance
    piece, since = 0, 0
    for k in range(len(velocity)):
        first = piece < len(starts) and k == starts[piece]
        if first:
            xx = xv = vv = 0.0
            piece, since = piece + 1, 0
        total = xx + position_sd**2
        variances[k] = total
        if resting[k] or (not first and resting[k - 1]):
            total = variances[k] = np.inf
            xx, xv, vv = position_sd**2, 0.0, (_LET_GO * push[1] * dry) ** 2
            since = _BEGINS
        of_x, of_v = xx / total, xv / total
        gains[k, 0], gains[k, 1] = of_x + far * of_v, kept * of_v
        vv -= of_v * xv
        xv -= of_x * xv
        xx -= of_x * xx
        known = math.sqrt(max(vv, 0.0))
        sign = 1.0
        if abs(velocity[k]) < _CERTAIN * known:
            sign = math.erf(velocity[k] / (known * math.sqrt(2.0)))
        elif velocity[k] == 0.0:
            sign = 0.0
        pushed = force_sd**2 + (1 - sign * sign) * dry**2
        xx += 2 * far * xv + far * far * vv + push[0] * push[0] * pushed
        xv = kept * (xv + far * vv) + push[0] * push[1] * pushed
        vv = kept * kept * vv + push[1] * push[1] * pushed
        if since < _BEGINS:
            vv += unknown**2
        since += 1
    return gains, variances


@kernel
def innovations_of(
    motion: Floats,
    gains: Floats,
    variances: Floats,
    starts: Ints,
    above: Floats,
    below: Floats,
    force: Floats,
    error: Floats,
) -> Floats:
    """What the filter does not foresee of errors, over its standard deviation; shape (N,).

    Zero while the mass rests.

    Parameters
    ----------
    motion, gains, variances, starts : ndarray
        As `gains_of` takes and gives them.
    above, below : ndarray
        Position over a command, in powers of 1/z; the first coefficient of `below` is 1.
    force : ndarray, shape (N,)
        Of the follower: what it does to the position is added to the error.
    error : ndarray, shape (N,)
        Measured less simulated position.
    """
    out, led = np.zeros_like(error), np.zeros_like(error)
    far, kept = motion[0, 1], motion[1, 1]
    x = v = 0.0
    piece = begun = 0
    for k in range(len(error)):
        if piece < len(starts) and k == starts[piece]:
            x = v = 0.0
            piece, begun = piece + 1, k
        if math.isinf(variances[k]):
            x, v, begun = error[k], 0.0, k
            continue
        for j in range(min(len(above), k - begun + 1)):
            led[k] += above[j] * force[k - j]
        for j in range(1, min(len(below), k - begun + 1)):
            led[k] -= below[j] * led[k - j]
        new = error[k] + led[k] - x
        out[k] = new / math.sqrt(variances[k])
        x += far * v + gains[k, 0] * new
        v = kept * v + gains[k, 1] * new
    return out
