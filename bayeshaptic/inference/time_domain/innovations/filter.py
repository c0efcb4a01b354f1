"""What a Kalman filter cannot foresee of a mass that a white force and its encoder disturb.

Errors of a motion that a follower leads are correlated.  Where a white force disturbs the mass, and
counts its measured position, the filter of R. E. Kalman ("A new approach to linear filtering and
prediction problems", Journal of Basic Engineering 82, 1960) makes of them errors that are not, the
innovations, and their least squares have the least variance that there is (L. Ljung, System
Identification, 1999, chapter 7).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.held_force import over_span, position_over_command
from bayeshaptic.types import Floats, Ints

_UNKNOWN = 100.0  # counts a sample, that a velocity may be off where a piece begins
# Samples after which it no longer matters how a piece begins: in three the command of before may
# still arrive, and two tell position and velocity.
_FORGOTTEN = 5
_HELD = 5  # samples without any motion, from which on the mass rests
_CLEAR = 1.5  # of the least variance: above it friction may have either sign


@dataclass(frozen=True)
class Disturbance:
    """Standard deviations of what disturbs a mass: a force from sample to sample, a position."""

    force_sd: float
    position_sd: float


@dataclass(frozen=True, eq=False)
class Innovations:
    """A linear map of errors to innovations, each over its standard deviation.

    Attributes
    ----------
    motion : ndarray, shape (2, 2)
        Position and velocity a sample later, without a force.
    gains : ndarray, shape (N, 2)
    variances : ndarray, shape (N,)
        Infinite while the mass rests.
    follower : Follower
        That led the motion; what it did to the position is added to the error.
    pieces : tuple of slice
    period_s : float
    """

    motion: Floats
    gains: Floats = field(repr=False)
    variances: Floats = field(repr=False)
    follower: Follower
    pieces: tuple[slice, ...]
    period_s: float

    @property
    def moving(self) -> NDArray[np.bool_]:
        """Samples that count, shape (N,)."""
        return np.isfinite(self.variances)

    @property
    def clear(self) -> NDArray[np.bool_]:
        """Samples at which dry friction has one sign for certain, shape (N,)."""
        usual = np.quantile(self.variances[self.moving], 0.1)
        known = self.variances < _CLEAR * usual
        for piece in self.pieces:
            known[piece.start : piece.start + _FORGOTTEN] = False
        return known

    def __call__(self, error: Floats, values: Floats) -> Floats:
        """Of errors that were led, shape (N,).

        What the follower did to the position goes with the values: taken from others, the motion
        would answer to the follower's force, which is made of the noise, as it does to the command.

        Parameters
        ----------
        error : ndarray, shape (N,)
        values : ndarray
            With which the motion was led: mass, viscous damping, dry friction, constant force,
            delay, and others.
        """
        from scipy.signal import lfilter

        from bayeshaptic.inference.time_domain.innovations.kernels import innovations_of

        led = self.follower
        force = np.concatenate([lfilter(led.above, led.below, error[one]) for one in self.pieces])
        mass, damping, _, _, delay_s = values[:5]
        answer = position_over_command(mass, damping, delay_s, self.period_s)
        beside = self.motion, self.gains, self.variances, _starts(self.pieces)
        return np.asarray(innovations_of(*beside, *answer, force, error))


def innovations(
    values: Floats,
    follower: Follower,
    velocity: Floats,
    pieces: tuple[slice, ...],
    disturbed: Disturbance,
    period_s: float,
) -> Innovations:
    """The filter beside a simulated motion.

    Dry friction has one sign or the other: where the velocity is no further from zero than the
    filter knows it, that is as good as a white force of its size.  While it holds the mass nothing
    counts.

    Parameters
    ----------
    values : ndarray, shape (5,)
        Mass, viscous damping, dry friction, constant force, delay.
    follower : Follower
        That led the motion.
    velocity : ndarray, shape (N,)
        Of that motion.
    pieces : tuple of slice
    disturbed : Disturbance
    period_s : float
    """
    from bayeshaptic.inference.time_domain.innovations.kernels import gains_of

    mass, damping, dry = values[:3]
    motion, push = over_span(mass, damping, period_s)
    unknown = _UNKNOWN * disturbed.position_sd / period_s
    sizes = np.array([disturbed.force_sd, disturbed.position_sd, dry, unknown])
    gains, variances = gains_of(motion, push, sizes, velocity, _rests(velocity), _starts(pieces))
    return Innovations(motion, gains, variances, follower, pieces, period_s)


def _rests(velocity: Floats) -> NDArray[np.bool_]:
    """Samples of runs of `_HELD` and more without any motion, shape (N,)."""
    from scipy.ndimage import binary_opening

    return np.asarray(binary_opening(velocity == 0.0, np.ones(_HELD)))


def _starts(pieces: Sequence[slice]) -> Ints:
    return np.array([piece.start for piece in pieces])
