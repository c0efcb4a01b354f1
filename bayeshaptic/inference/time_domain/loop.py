"""A recording, and the motion of one mass simulated beside it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference.time_domain.follower import Follower, spring_and_damper
from bayeshaptic.inference.time_domain.uneven import WAVES, Way, waves
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

PLAIN = 7  # mass, damping, dry friction, constant force, delay; position and velocity at the start
LOWEST = np.array([0.0, 0.0, 0.0, -np.inf, 0.0, -np.inf, -np.inf])
_INDEPENDENT = 3.0  # samples that a second is worth, a hertz of bandwidth
_FEWEST = 20  # independent samples
_TRIALS = 10
_CALMER = 1.6  # the bandwidth is lowered by this until the start can be simulated


@dataclass(frozen=True)
class Loop:
    """A recording with a follower, and the motion of one mass beside it.

    Attributes
    ----------
    force, position : ndarray, shape (N,)
    period_s, bandwidth_hz : float
    shapes : ndarray, shape (WAVES, N)
        Of the force that changes along the way.
    follower : Follower or None
        None until `led`.
    """

    force: Floats = field(repr=False)
    position: Floats = field(repr=False)
    period_s: float
    bandwidth_hz: float
    shapes: Floats = field(repr=False)
    follower: Follower | None = None

    @classmethod
    def of(cls, recording: Recording, bandwidth_hz: float, way: Way) -> Loop:
        """Of a recording, with the waves of a way."""
        force, position = np.array(recording.force), np.array(recording.position)
        return cls(force, position, recording.period_s, bandwidth_hz, waves(position, way))

    @property
    def independent(self) -> float:
        """How many independent samples this is worth, about."""
        seconds = len(self.force) * self.period_s
        return max(_INDEPENDENT * self.bandwidth_hz * seconds, _FEWEST)

    def led(self, feedback: Follower | None, start: Floats, share: float = 1.0) -> Loop:
        """With the declared follower, or one of `share` times the bandwidth that is stable."""
        width = share * self.bandwidth_hz
        for _ in range(_TRIALS):
            chosen = feedback or spring_and_damper(start[0], width, self.period_s)
            loop = replace(self, bandwidth_hz=width, follower=chosen)
            error = loop.error(start, np.zeros(2 * WAVES))
            if np.all(np.isfinite(error)) and np.abs(error).max() < 10 * np.ptp(self.position):
                break
            width, feedback = width / _CALMER, None
        return loop

    def error(self, values: Floats, uneven: Floats) -> Floats:
        """Measured less simulated position, shape (N,)."""
        from bayeshaptic.inference.time_domain.kernels import follow

        assert self.follower is not None
        forward, backward = uneven.reshape(2, WAVES) @ self.shapes
        above, below = self.follower.above, self.follower.below
        with np.errstate(all="ignore"):
            return self.position - follow(
                values, forward, backward, self.force, self.position, above, below, self.period_s
            )

    def columns(self, values: Floats, uneven: Floats, error: Floats) -> Floats:
        """How the simulated position moves with every value and wave, shape (N, C)."""
        size = float(np.std(self.force))
        steps = np.array(
            [
                1e-3 * values[0],
                1e-2 * max(values[1], values[0]),
                2e-3 * size,
                2e-3 * size,
                0.05 * self.period_s,
                1e-6 * np.ptp(self.position),
                1e-4 * np.std(np.diff(self.position)) / self.period_s,
            ]
        )
        out = np.empty((len(error), PLAIN + 2 * WAVES))
        for i, step in enumerate(steps):
            up, down = values.copy(), values.copy()
            up[i] += step
            down[i] = max(down[i] - step, LOWEST[i])
            span = up[i] - down[i]
            out[:, i] = (self.error(down, uneven) - self.error(up, uneven)) / span
        for i in range(2 * WAVES):
            more = uneven.copy()
            more[i] += 1e-3 * size
            out[:, PLAIN + i] = (error - self.error(values, more)) / (1e-3 * size)
        return out
