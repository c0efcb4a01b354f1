"""Which pairs of stiffness K and damping B a virtual wall may have, and with what probability."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.models.model import Model
from bayeshaptic.quantities import quantity
from bayeshaptic.shown import Shown
from bayeshaptic.stability.tail import ENOUGH_BELOW
from bayeshaptic.stability.walls.count import beyond_start, pairs_of, unstable_at_start
from bayeshaptic.stability.walls.curve import (
    InverseCurve,
    KbCurve,
    along_damping,
    along_stiffness,
    inverse_curve,
    kb_curve,
)
from bayeshaptic.stability.walls.damping import Backward, Damping
from bayeshaptic.stability.walls.loops import loops_of
from bayeshaptic.stability.walls.width import Boundary, ZWidth, width_of
from bayeshaptic.types import Floats

DRAWS = 4000
LEVELS = 33  # dampings in a table
_START = 1e-3  # of K_CR: where a loop that is stable at rest is still stable
INSIDE = 1 - 1e-6  # of the largest damping: the very tip of a region is a matter of rounding


@dataclass(frozen=True, eq=False, repr=False)
class KbRegion(Shown):
    """The stable region of C(z) = K + B D(z) for each loop of a posterior, or of one model.

    Attributes
    ----------
    curve : KbCurve
    start : ndarray, shape (n,)
        A stiffness at which each loop is stable without damping; nan where there is none.
    critical : ndarray, shape (n,)
        K_CR without damping.
    effective : float
        Effective number of the draws.
    unit, damping_unit : str
    """

    curve: KbCurve = field(repr=False)
    start: Floats = field(repr=False)
    critical: Floats = field(repr=False)
    effective: float
    unit: str

    def _lines(self) -> tuple[str, ...]:
        stiffest, largest = (float(np.median(v)) for v in (self.critical, self.largest_damping()))
        return (
            f"Stable walls with velocity by {self.kind.label}: {len(self.start):,} loops",
            f"without damping up to {quantity(stiffest, self.unit)} (median)",
            f"damping up to {quantity(largest, self.damping_unit)} (median)",
        )

    @property
    def kind(self) -> Damping:
        """What D is."""
        return self.curve.kind

    @property
    def period_s(self) -> float:
        return self.curve.inverse.period_s

    @property
    def damping_unit(self) -> str:
        force, position = self.unit.split("/")
        return f"{force} s/{position}"

    @at_the_door
    def limits(self, damping: ArrayLike) -> Floats:
        """The stiffness up to which each loop is stable at dampings (J,), shape (n, J).

        It is where the stable interval ends that begins at K = 0+; 0 without such an interval.

        Parameters
        ----------
        damping : array_like, shape (J,)
        """
        levels, back = np.unique(np.asarray(damping, float), return_inverse=True)
        unstable = unstable_at_start(self.curve, self.start, levels)
        events = along_stiffness(self.curve, levels, self.start)
        above = events.place > self.start[events.row]
        limit = np.full(unstable.shape, np.inf)
        np.minimum.at(limit, (events.row[above], events.level[above]), events.place[above])
        return np.where(unstable == 0, limit, 0.0)[:, back.ravel()]

    def largest_damping(self) -> Floats:
        """The damping up to which each loop is stable with a stiffness near zero, shape (n,)."""
        start = np.where(np.isnan(self.start), 1.0, self.start)
        events = along_damping(self.curve, start)
        largest = np.full(len(self.start), np.inf)
        above = events.place > 0
        np.minimum.at(largest, events.row[above], events.place[above])
        return np.where(np.isnan(self.start), 0.0, largest)

    @at_the_door
    def probability(self, stiffness: ArrayLike, damping: ArrayLike) -> Any:
        """P(stable | K, B) of pairs that broadcast against each other; a float, or an array.

        A loop is stable where none of its poles is outside the unit circle; one that is unstable
        at rest (K -> 0, B = 0) counts as unstable everywhere.

        Parameters
        ----------
        stiffness, damping : array_like
        """
        k, b = pairs_of(stiffness, damping)
        levels, column = np.unique(b, return_inverse=True)
        heights, row = np.unique(k, return_inverse=True)
        share = self.probability_map(heights, levels)[column.ravel(), row.ravel()]
        return float(share[0]) if k.ndim == 0 else share.reshape(k.shape)

    def probability_map(self, stiffness: ArrayLike, damping: ArrayLike) -> Floats:
        """P(stable) on a grid, shape (J, I).

        Parameters
        ----------
        stiffness, damping : array_like, shapes (I,) and (J,)
            Both ascending.
        """
        return np.asarray(self.stable(stiffness, damping, mean=True))

    def stable(self, stiffness: ArrayLike, damping: ArrayLike, mean: bool = False) -> Any:
        """Which loops are stable on a grid.

        Parameters
        ----------
        stiffness, damping : array_like, shapes (I,) and (J,)
            Both ascending.
        mean : bool

        Returns
        -------
        ndarray
            Of bool, shape (n, J, I); with `mean` the share of the loops, shape (J, I).
        """
        heights, levels = np.asarray(stiffness, float), np.asarray(damping, float)
        unstable = unstable_at_start(self.curve, self.start, levels)
        events = along_stiffness(self.curve, levels)
        count = len(self.start)
        cells = 4_000_000  # of loops, dampings and stiffnesses at a time
        step = max(cells // (len(heights) * len(levels)), 1)
        parts = []
        for first in range(0, count, step):
            rows = np.arange(first, min(first + step, count))
            poles = beyond_start(events, rows, heights, len(levels), self.start)
            parts.append(unstable[rows, :, None] + poles == 0)
        if mean:
            return np.sum([part.sum(axis=0) for part in parts], axis=0) / count
        return np.concatenate(parts)

    @at_the_door
    def quantile(self, risk: float, damping: ArrayLike) -> Floats:
        """The stiffness that is unstable with probability `risk`, shape (J,).

        Parameters
        ----------
        risk : float
        damping : array_like, shape (J,)
        """
        return np.quantile(self.limits(damping), risk, axis=0, method="inverted_cdf")

    @at_the_door
    def says(self, risk: float) -> bool:
        """Whether 20 effective draws lie below a stiffness of that `risk`."""
        return self.effective * risk >= ENOUGH_BELOW

    def dampings(self, count: int = LEVELS) -> Floats:
        """Dampings from zero to the largest that is stable in 95 % of the draws, shape (count,)."""
        top = float(np.quantile(self.largest_damping(), 0.05, method="inverted_cdf"))
        return np.linspace(0.0, INSIDE * top if np.isfinite(top) else 1.0, count)

    @at_the_door
    def boundaries(self, risks: tuple[float, ...], damping: ArrayLike) -> tuple[Boundary, ...]:
        """The boundary at each risk, with one evaluation of the loops.

        Parameters
        ----------
        risks : tuple of float
        damping : array_like, shape (J,)
        """
        levels = np.asarray(damping, float)
        limits = np.sort(self.limits(levels), axis=0)
        place = [max(int(np.ceil(risk * len(limits))) - 1, 0) for risk in risks]
        return tuple(Boundary(r, levels, limits[p]) for r, p in zip(risks, place, strict=True))

    @at_the_door
    def z_width(self, risk: float, count: int = LEVELS) -> ZWidth:
        """The range of walls that are each unstable with at most the probability `risk`.

        Parameters
        ----------
        risk : float
        count : int
            Dampings to look at.
        """
        largest = float(np.quantile(self.largest_damping(), risk, method="inverted_cdf"))
        if not np.isfinite(largest):
            raise InputError("nothing limits the damping of this loop; it has no Z-width.")
        (boundary,) = self.boundaries((risk,), np.linspace(0.0, INSIDE * largest, count))
        return width_of(boundary)


@at_the_door
def kb_region(
    source: Any,
    damping: Damping | None = None,
    theta: ArrayLike | None = None,
    draws: int = DRAWS,
) -> KbRegion:
    """The region of stable walls of a model at its own values, or of every draw of a posterior.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed
        Where it has a `limit`, the region is stretched draw by draw (by rank, where the limit is
        not one of the draws) so that without damping it is just that limit: what widens K_CR
        beyond the parameters' spread (an effect's strength, what remains unexplained) widens the
        region alike.
    damping : Backward or LowPass, optional
        How the damping term gets its velocity; by default the backward difference.
    theta : array_like, shape (n, P) or (P,), optional
        With a model: the parameter vectors to use.
    draws : int
        A longer posterior is thinned to about so many.

    Returns
    -------
    KbRegion

    Raises
    ------
    InputError
        If the model has no values or no sampling period.

    Notes
    -----
    In closed form, without eigenvalues: see `stability.kb_curve`.  A loop's stable region is the
    one that touches the origin and all other pairs without a pole outside the unit circle.
    """
    loops = loops_of(source, theta, draws)
    region = region_of_draws(loops.model, loops.draws, damping or Backward(), None, loops.effective)
    if loops.target is None:
        return region
    if loops.aligned:
        return _stretched(region, loops.target)
    return _stretched(region, loops.target[np.argsort(np.argsort(region.critical))])


def region_of_draws(
    model: Model,
    draws: Floats,
    kind: Damping,
    critical: Floats | None = None,
    effective: float = np.nan,
) -> KbRegion:
    """The region of parameter vectors (n, P), stretched to a stated K_CR of each, shape (n,)."""
    assert model.period_s is not None
    inverse = inverse_curve(model.system(draws), model.period_s)
    own = _critical(inverse)
    known = np.where(np.isfinite(own), own, np.abs(inverse.nyquist))
    start = np.where(own > 0, _START * known, np.nan)
    region = KbRegion(kb_curve(inverse, kind), start, own, effective, model.stiffness_unit)
    return region if critical is None else _stretched(region, critical)


def _stretched(region: KbRegion, wanted: Floats) -> KbRegion:
    """With every boundary scaled so that K_CR without damping is the one that is wanted, (n,)."""
    own = region.critical
    usable = np.isfinite(own) & (own > 0) & np.isfinite(wanted) & (wanted > 0)
    factor = np.where(usable, wanted / np.where(usable, own, 1.0), 1.0)
    curve = kb_curve(region.curve.inverse.scaled(factor), region.kind)
    return replace(region, curve=curve, start=region.start * factor, critical=own * factor)


def with_damping(region: KbRegion, kind: Damping) -> KbRegion:
    """The same loops with another way to get the velocity; the response is evaluated once only."""
    return replace(region, curve=kb_curve(region.curve.inverse, kind))


def _critical(inverse: InverseCurve) -> Floats:
    """K_CR without damping, shape (n,)."""
    none = np.zeros(len(inverse.nyquist))
    events = along_stiffness(kb_curve(inverse, Backward()), np.zeros(1), none)
    above = events.place > 0
    critical = np.full(len(none), np.inf)
    np.minimum.at(critical, events.row[above], events.place[above])
    return np.where(inverse.response.stable_at_rest(), critical, 0.0)
