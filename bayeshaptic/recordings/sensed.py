r"""What was sensed of force and motion, and what splines make of it as a command and a position.

A spline of order n through samples at every period puts, of a tone at the angle :math:`\theta`, the
share :math:`\theta_k^{-n-1} / \sum_m \theta_m^{-n-1}` at each :math:`\theta_k = \theta + 2 \pi k`
(I. J. Schoenberg, *Cardinal Spline Interpolation*, 1973): with it the transfer of whatever is read
off the spline, an integral or a value between the samples, is known exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.types import Complexes, Floats

ORDER = 5  # of the splines
_IMAGES = 12  # on either side; the next are below 1e-8


@dataclass(frozen=True)
class Sensed:
    """What a recording was before it was turned into a command and a position.

    Attributes
    ----------
    measured_force : bool
        The force was measured where it acts, at its instant; no hold is between the two.
    derivatives : int
        0 for a position, 1 for a velocity, 2 for an acceleration.
    force, output : ndarray, shape (N,)
        As they were sensed.
    later : float
        Periods by which a measured force was made a command that acts later.
    """

    measured_force: bool
    derivatives: int
    force: Floats = field(repr=False, compare=False)
    output: Floats = field(repr=False, compare=False)
    later: float = 0.0

    def part(self, start: int, stop: int) -> Sensed:
        """The samples from `start` up to but without `stop`."""
        return replace(self, force=self.force[start:stop], output=self.output[start:stop])

    def known_then(self) -> tuple[Floats, Floats]:
        """Force and position as far as each sample tells; splines know the next ones, too.

        A velocity tells of the position up to its own sample; an acceleration, which answers to the
        force at once, counts from the next one on.
        """
        motion = self.output
        for number in range(self.derivatives):
            motion = np.cumsum(motion - motion.mean())
            if self.derivatives > 1 and number == 0:
                motion = np.concatenate([[0.0], motion[:-1]])
        return self.force, motion

    def noise(self, theta: Floats) -> Floats:
        """Power of the sensor's noise over that in the position, at angles w T; shape (L,)."""
        return np.asarray(1 / np.abs(self.integral(theta)) ** 2)

    def integral(self, theta: Floats) -> Complexes:
        """What integrating by splines multiplies, over the period for each time; shape (L,)."""
        return _of_spline(theta, lambda s: 1 / s) ** self.derivatives

    def command(self, theta: Floats) -> Complexes:
        """The command that stands for a measured force, over that force; shape (L,)."""
        held = _of_spline(theta, lambda s: np.exp(s / 2) * (1 - s**2 / 24 + 7 * s**4 / 5760))
        whole, part = np.floor(self.later), self.later % 1
        shifted = _of_spline(theta, lambda s: np.exp(s * part))
        return held * shifted * np.exp(1j * theta * whole)


def _of_spline(theta: Floats, read: Callable[[Complexes], Complexes]) -> Complexes:
    """The transfer of what is read off the spline, as a function of s over the sampling rate."""
    angles = theta[:, None] + 2 * np.pi * np.arange(-_IMAGES, _IMAGES + 1)
    share = (theta[:, None] / angles) ** (ORDER + 1)
    values = np.sum(share * read(1j * angles), axis=1)
    return np.asarray(values / np.sum(share, axis=1))
