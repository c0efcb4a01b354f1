"""What draws of a stability limit say: its quantiles, and how likely a stiffness is unstable."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.arguments import at_the_door
from bayeshaptic.stability.tail import quantiles
from bayeshaptic.types import Floats


class LimitDraws:
    """Draws of a limit, of one case or of the lowest of several.

    Attributes
    ----------
    samples : ndarray, shape (n,)
        In `unit`; infinite where nothing limits the stiffness.
    unit : str
    """

    samples: Floats
    unit: str

    @at_the_door
    def quantile(self, p: ArrayLike) -> Any:
        """The stiffness that the limit is below with probability `p`, a float or an array as `p`.

        Parameters
        ----------
        p : float or array_like
            0 to 1.
        """
        levels = np.asarray(p, float)
        found = quantiles(self._ordered, levels)
        return float(found) if levels.ndim == 0 else found

    @at_the_door
    def db(self, p: ArrayLike = 0.5) -> Any:
        """`quantile` of `p` in decibels, 20 log10 of the number in `unit`."""
        with np.errstate(divide="ignore"):
            return 20 * np.log10(self.quantile(p))

    @at_the_door
    def probability_unstable(self, stiffness: ArrayLike) -> Any:
        """P(limit < stiffness), the share of draws below it; a float, or an array as `stiffness`.

        Parameters
        ----------
        stiffness : float or array_like
            In `unit`.
        """
        below = np.searchsorted(self._ordered, stiffness, side="left")
        return below / len(self.samples)

    # A page asks for the same few numbers some fifty times.
    @cached_property
    def _ordered(self) -> Floats:
        return np.sort(self.samples)
