"""How likely the counts of one mass are, that dry friction and a white force act on.

The position is known to lie within half a count of what is recorded, and the command is known
exactly, whatever made it: so the probability of every count after those before is the likelihood of
a loop (L. Ljung, System Identification, 1999, section 7.4), and no noise of the counts is asked to
be independent of a command that was made of them.  The density of the state is followed as a sum of
normal ones, each of the same means and covariances as what becomes of it (D. L. Alspach and H. W.
Sorenson, "Nonlinear Bayesian estimation using Gaussian sum approximations", IEEE Transactions on
Automatic Control 17, 1972).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.inference.time_domain.held_force import over_span
from bayeshaptic.types import Floats

_LEAST = 1e-6  # of a period, that the old command acts in each


@dataclass(frozen=True, eq=False)
class Followed:
    """What the counts were after those before.

    Attributes
    ----------
    likely : ndarray, shape (N,)
        Logarithms of their probabilities; zero for the first few.
    innovations : ndarray, shape (N,)
        By how much a count moves the position that is expected, over what is usual: each is zero on
        average whatever came before.
    velocity : ndarray, shape (N,)
        Expected.
    work : ndarray, shape (N,)
        How many normals were added.
    """

    likely: Floats
    innovations: Floats
    velocity: Floats
    work: Floats


@dataclass(frozen=True)
class Counts:
    """A recording whose positions are counts.

    Attributes
    ----------
    command, position : ndarray, shape (N,)
    period_s : float
    unit : float
        One count.
    cells : int
        Parts that a count is cut into.
    """

    command: Floats = field(repr=False)
    position: Floats = field(repr=False)
    period_s: float
    unit: float
    cells: int

    def after(self, values: Floats, force_sd: float, more: Floats | None = None) -> Followed:
        """The counts after those before.

        Parameters
        ----------
        values : ndarray, shape (5,)
            Mass, viscous damping, dry friction, constant force, delay.
        force_sd : float
            Of a white force, held from one change of the delayed command to the next.
        more : ndarray, shape (N,), optional
            A further force.
        """
        from bayeshaptic.inference.time_domain.counts.kernels import followed

        mass, damping, dry, offset, delay_s = values.tolist()
        whole = math.floor(delay_s / self.period_s)
        # A part that vanished would leave out a look at friction: the likelihood would jump there.
        late = min(max(delay_s / self.period_s - whole, _LEAST), 1 - _LEAST)
        late_s = late * self.period_s
        spans = late_s, self.period_s - late_s
        moves = (over_span(mass, damping, span) for span in spans)
        kept = np.array([(motion[1, 1], motion[0, 1], *push) for motion, push in moves])
        loads = np.array([dry, offset, force_sd, whole, late_s, self.period_s])
        further = np.zeros(len(self.position)) if more is None else more
        signals = further, self.command, self.position
        return Followed(*followed(kept, loads, *signals, self.unit, self.cells))
