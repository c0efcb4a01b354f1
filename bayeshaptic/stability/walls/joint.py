"""Stable walls over all cases of a device: whoever holds it, wherever it stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.stability.tail import ENOUGH_BELOW
from bayeshaptic.stability.walls.damping import Backward, Damping, LowPass
from bayeshaptic.stability.walls.region import DRAWS, INSIDE, KbRegion, kb_region, with_damping
from bayeshaptic.types import Floats

CUTOFF = 0.1  # of the sampling rate: the usual low-pass of a velocity


@dataclass(frozen=True, eq=False)
class JointRegion:
    """The walls that are stable in every case, cases taken as independent of each other.

    Attributes
    ----------
    regions : tuple of KbRegion
        One a case, with the same damping term.
    labels : tuple of str
    """

    regions: tuple[KbRegion, ...] = field(repr=False)
    labels: tuple[str, ...]

    @property
    def kind(self) -> Damping:
        return self.regions[0].kind

    @property
    def period_s(self) -> float:
        return self.regions[0].period_s

    @property
    def unit(self) -> str:
        return self.regions[0].unit

    @property
    def damping_unit(self) -> str:
        return self.regions[0].damping_unit

    def says(self, risk: float) -> bool:
        """Whether 20 effective draws lie below a stiffness of that risk."""
        return min(region.effective for region in self.regions) * risk >= ENOUGH_BELOW

    def limits(self, damping: ArrayLike) -> tuple[Floats, ...]:
        """The limits of each case at dampings (J,), shape (n_c, J) each; see `KbRegion.limits`."""
        return tuple(region.limits(damping) for region in self.regions)

    def probability_map(self, stiffness: ArrayLike, damping: ArrayLike) -> Floats:
        """The probability of being stable in every case, on a grid.

        Parameters
        ----------
        stiffness, damping : array_like, shape (I,), (J,)
            Both ascending, in `unit` and `damping_unit`.

        Returns
        -------
        ndarray, shape (J, I)
        """
        maps = [region.probability_map(stiffness, damping) for region in self.regions]
        return np.asarray(np.prod(maps, axis=0))

    def dampings(self, risks: Sequence[float], count: int) -> Floats:
        """Dampings at which to compute boundaries.

        The steps are closest at zero, where limits rise most steeply, and reach the damping that
        is unstable in 95 % of the draws.

        Parameters
        ----------
        risks : sequence of float
            Risks of the boundaries; the damping at which each ends is among the result.
        count : int
            Number of steps.

        Returns
        -------
        ndarray, shape (J,)
            Ascending from zero, in `damping_unit`.
        """
        largest = [np.sort(region.largest_damping())[:, None] for region in self.regions]
        totals = [len(part) for part in largest]
        beyond = 0.95
        every = (*risks, beyond)
        ends = lowest(largest, totals)
        wanted = np.array([ends.quantile(risk)[0] for risk in every])
        known = INSIDE * wanted[np.isfinite(wanted)]
        closer = 1.5
        steps = np.linspace(0.0, 1.0, count) ** closer * (known.max() if len(known) else 1.0)
        return np.unique(np.concatenate([steps, known]))


def joint_region(cases: Sequence[Any], draws: int = DRAWS) -> JointRegion:
    """The region of one case or several, of backward differences.

    Parameters
    ----------
    cases : sequence of Case
    draws : int
        Of each case.
    """
    regions = tuple(kb_region(case, Backward(), draws=draws) for case in cases)
    return JointRegion(regions, tuple(case.label for case in cases))


def filtered(region: JointRegion, kind: Damping) -> JointRegion:
    """The region of the same draws with another way to get the velocity."""
    return replace(region, regions=tuple(with_damping(part, kind) for part in region.regions))


def usual_dampings(period_s: float) -> tuple[Damping, ...]:
    """The backward difference by itself, and behind a low-pass at a tenth of the rate."""
    return Backward(), LowPass(CUTOFF / period_s)


@dataclass(frozen=True)
class Lowest:
    """Distribution of the smallest of independent variables, level by level.

    Attributes
    ----------
    places : ndarray, shape (M, J)
        Ascending.
    share : ndarray, shape (M, J)
        Probability of a value up to there.
    """

    places: Floats
    share: Floats

    def quantile(self, risk: float) -> Floats:
        """The value that the smallest is below with probability `risk`, shape (J,)."""
        reached = np.argmax(self.share >= risk - 1e-9, axis=0)
        return np.take_along_axis(self.places, reached[None], axis=0)[0]


def lowest(limits: Sequence[Floats], totals: Sequence[int]) -> Lowest:
    """The distribution of the smallest of some variables, by their draws.

    Parameters
    ----------
    limits : sequence of ndarray, shapes (n_c, J)
        The lowest of the draws of each variable, each column in ascending order.
    totals : sequence of int
        How many draws they are the lowest of.
    """
    places = limits[0] if len(limits) == 1 else np.sort(np.concatenate(limits), axis=0)
    if len(limits) == 1:
        share = np.arange(1, len(places) + 1)[:, None] / totals[0]
        return Lowest(places, np.broadcast_to(share, places.shape))
    above = np.ones_like(places)
    for part, total in zip(limits, totals, strict=True):
        for level in range(places.shape[1]):
            count = np.searchsorted(part[:, level], places[:, level], side="right")
            above[:, level] *= 1 - count / total
    return Lowest(places, 1 - above)
