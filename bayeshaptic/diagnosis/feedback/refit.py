"""A motion of one mass fitted again with more in it, where that is worth it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import MotionFit, fit_motion
from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.mass_forces import MassForces
from bayeshaptic.inference.time_domain.mass_in_loop import Hum
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

# Of the error's power, that a force must take away: steps of a sample leave up to 0.08 of an error
# as small as the encoder's to a law that has joined.
_WORTH = 0.1


def is_worth_it(left: float) -> bool:
    """Whether a force is, that leaves such a share of the error's power."""
    return left < 1 - _WORTH


@dataclass(frozen=True)
class Refit:
    """How a recording is fitted: beside `follower`, or one that stands for a controller."""

    recording: Recording
    follower: Follower | None

    def with_more(
        self,
        motion: MotionFit,
        start: Floats,
        forces: MassForces | None = None,
        hums: tuple[Hum, ...] | None = None,
    ) -> MotionFit | None:
        """`motion` with other forces or hums, from the values `start` on.

        None where no motion stays near the measured one, and where the error is not worth it.
        """
        forces = motion.forces if forces is None else forces
        hums = motion.hums if hums is None else hums
        try:
            more = fit_motion(self.recording, self.follower, forces, start, hums)
        except (InputError, np.linalg.LinAlgError):
            return None
        return more if is_worth_it((more.error_rms / motion.error_rms) ** 2) else None
