"""A Kalman filter beside the simulated motion of a mass, in compiled passes over the samples."""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats, Ints

_CERTAIN = 8.0  # standard deviations of a velocity, beyond which its sign is certain
_BEGINS = 3  # samples in which the command of before the recording arrives


@kernel
def gains_of(
    motion: Floats,
    push: Floats,
    sizes: Floats,
    velocity: Floats,
    starts: Ints,
) -> tuple[Floats, Floats]:
    """The filter's gains, shape (N, 2), and its innovations' variances, shape (N,).

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
    starts : ndarray of int, shape (J,)
        Where the pieces begin.
    """
    force_sd, position_sd, dry, unknown = sizes
    gains, variances = np.empty((len(velocity), 2)), np.empty(len(velocity))
    far, kept = motion[0, 1], motion[1, 1]
    xx = xv = vv = 0.0  # the state's covariance
    piece, since = 0, 0
    for k in range(len(velocity)):
        if piece < len(starts) and k == starts[piece]:
            xx = xv = vv = 0.0
            piece, since = piece + 1, 0
        total = xx + position_sd**2
        variances[k] = total
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
    motion: Floats, gains: Floats, variances: Floats, starts: Ints, error: Floats
) -> Floats:
    """What the filter does not foresee of errors, over its standard deviation; shape (N,).

    Parameters
    ----------
    motion, gains, variances, starts : ndarray
        As `gains_of` takes and gives them.
    error : ndarray, shape (N,)
        Measured less simulated position.
    """
    out = np.empty_like(error)
    far, kept = motion[0, 1], motion[1, 1]
    x = v = 0.0
    piece = 0
    for k in range(len(error)):
        if piece < len(starts) and k == starts[piece]:
            x = v = 0.0
            piece += 1
        new = error[k] - x
        out[k] = new / math.sqrt(variances[k])
        x += far * v + gains[k, 0] * new
        v = kept * v + gains[k, 1] * new
    return out
