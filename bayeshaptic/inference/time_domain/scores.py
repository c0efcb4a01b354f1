"""Whether a force that the fit of a motion lacks would explain what it leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.time_domain.fit import MotionFit
from bayeshaptic.inference.time_domain.linearised import linearised
from bayeshaptic.inference.time_domain.widths.correlated import spread_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Score:
    """What a step of Gauss-Newton towards a further force says, everything else fitted with it.

    Attributes
    ----------
    strength, sd : float
        Of a force, over that of strength one.
    left : float
        Share of the error's power that it leaves.
    """

    strength: float
    sd: float
    left: float

    @property
    def t(self) -> float:
        """Student's t, of as many degrees of freedom as the covariance of a fit."""
        return self.strength / self.sd


def scores(motion: MotionFit, recording: Recording, forces: Sequence[Floats]) -> list[Score | None]:
    """A score for every force; None for one that says nothing here.

    A force's mean is the constant force, which is fitted with everything else: what scores is the
    rest, and a force without one (the size of a command of two levels) says nothing.

    Parameters
    ----------
    motion : MotionFit
        Of the recording.
    recording : Recording
    forces : sequence of ndarray, shape (N,)
        Of strength one, as the measured motion says.
    """
    there = linearised(motion.loop(recording), motion.whole, motion.uneven)
    columns, found = there.columns, there.found
    left = there.without(found.solution)
    scored: list[Score | None] = []
    its_own = 1e-9  # share of a force, and of an answer's power: less is rounding
    for force in forces:
        rest = force - np.mean(force)
        if not np.std(rest) > its_own * np.max(np.abs(force)):
            scored.append(None)
            continue
        answer = there.loop.answer(there.values, there.uneven, there.error, rest)
        along = columns.T @ answer
        own = answer - columns @ (found.inverse @ along)  # what no other column does
        power = float(own @ answer)
        if not power > its_own * float(answer @ answer):
            scored.append(None)
            continue
        strength = float(own @ left) / power
        after = left - strength * own
        variance = spread_of(own, after, along, found, there.loop.independent)
        sd = float(np.sqrt(variance)) / power
        scored.append(Score(strength, sd, float(after @ after) / float(left @ left)))
    return scored
