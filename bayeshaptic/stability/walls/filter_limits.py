"""The stiffness that a wall may have over its damping, with one way to get the velocity."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bayeshaptic.stability.cases import Case
from bayeshaptic.stability.walls.damping import Damping
from bayeshaptic.stability.walls.fitted_tail import effective_of, fitted_boundary
from bayeshaptic.stability.walls.joint import JointRegion, Lowest, lowest
from bayeshaptic.stability.walls.loops import loops_of
from bayeshaptic.stability.walls.region import INSIDE
from bayeshaptic.stability.walls.tail import Tail, lower_tail
from bayeshaptic.stability.walls.width import Boundary, ZWidth, width_of
from bayeshaptic.types import Floats

ROWS = 25  # dampings a filter


@dataclass(frozen=True, eq=False)
class FilterLimits:
    """The stiffness that a wall may have over its damping, with one way to get the velocity.

    Attributes
    ----------
    region : JointRegion
    damping : ndarray, shape (J,)
        Ascending from zero; the end of the boundary at each risk is among them.
    limits : tuple of ndarray, shapes (n_c, J)
        Limits of some draws of each case, each column in ascending order.
    tails : tuple of Tail, or None
        The lowest limits of more draws of each case, for small risks.
    fitted : mapping
        Risk to the stiffness from fitted tails, shape (J,), where the draws are too few otherwise.
    undamped : mapping
        Risk to the stiffness without damping that is stated from all draws, or None: the boundary
        begins there, and is not stated where that is not.
    """

    region: JointRegion = field(repr=False)
    damping: Floats = field(repr=False)
    limits: tuple[Floats, ...] = field(repr=False)
    tails: tuple[Tail, ...] | None = field(repr=False, default=None)
    fitted: Mapping[float, Floats] = field(repr=False, default_factory=dict)
    undamped: Mapping[float, float | None] = field(repr=False, default_factory=dict)

    @property
    def kind(self) -> Damping:
        return self.region.kind

    def quantile(self, risk: float) -> Floats:
        """The stiffness at that risk whether or not the draws are enough for it, shape (J,)."""
        return self._lowest.quantile(risk)

    def boundary(self, risk: float) -> Boundary | None:
        """The stiffness at that risk; None where the draws are too few to state it."""
        found = self._boundary(risk)
        if found is None or risk not in self.undamped or self.damping[0] != 0:
            return found
        first = self.undamped[risk]
        if first is None:
            return None
        return replace(found, stiffness=np.r_[first, found.stiffness[1:]])

    def _boundary(self, risk: float) -> Boundary | None:
        if self.region.says(risk):
            return Boundary(risk, self.damping, self.quantile(risk))
        if self.tails is None or risk > min(tail.risk for tail in self.tails):
            fitted = self.fitted.get(risk)
            return None if fitted is None else Boundary(risk, self.damping, fitted)
        return Boundary(risk, self.damping, self._from_tails(risk))

    def _from_tails(self, risk: float) -> Floats:
        tails = self.tails or ()
        return lowest([t.limits for t in tails], [t.total for t in tails]).quantile(risk)

    @cached_property
    def _lowest(self) -> Lowest:
        return lowest(self.limits, [len(part) for part in self.limits])

    def width(self, risk: float) -> ZWidth | None:
        """How wide the range of walls is at that risk; None where the draws are too few."""
        boundary = self.boundary(risk)
        return None if boundary is None else width_of(boundary)


def filter_limits(
    cases: Sequence[Case], region: JointRegion, risks: tuple[float, ...], draws: int
) -> FilterLimits:
    """The limits of a device with one way to get the velocity.

    Parameters
    ----------
    cases : sequence of Case
    region : JointRegion
        Of the same cases, with that velocity.
    risks : tuple of float
        Risks that are to be stated.
    draws : int
        How many draws of each case are looked at for the smallest of them.
    """
    levels = region.dampings(risks, ROWS)
    limits = region.limits(levels)
    tails = None
    if not region.says(min(risks)):
        tails = _tails(cases, region, levels, limits, min(risks), draws)
    if tails is not None:  # the table has the end of this boundary, too
        ends = [tail.ends[:, None] for tail in tails]
        end = INSIDE * lowest(ends, [tail.total for tail in tails]).quantile(min(risks))[0]
        place = int(np.searchsorted(levels, end))
        levels, there = np.insert(levels, place, end), region.limits([end])
        limits = tuple(
            np.insert(own, place, new[:, 0], axis=1) for own, new in zip(limits, there, strict=True)
        )
        tails = tuple(tail.at(levels) for tail in tails)
    ordered = tuple(np.sort(part, axis=0) for part in limits)
    return _with_fitted(cases, FilterLimits(region, levels, ordered, tails), risks)


def _with_fitted(
    cases: Sequence[Case], part: FilterLimits, risks: tuple[float, ...]
) -> FilterLimits:
    """With tails fitted for the risks that draws do not say; none below one that is not stated."""
    effective = [
        effective_of(case.limit, len(own)) for case, own in zip(cases, part.limits, strict=True)
    ]
    larger = np.full(len(part.damping), np.inf)
    for risk in sorted(risks, reverse=True):
        if part.boundary(risk) is None:
            fitted = fitted_boundary(part.damping, part.limits, effective, risk, larger)
            if fitted is None:
                break
            if part.tails is not None:  # what they say of a smaller risk is not above
                fitted = np.maximum(fitted, part._from_tails(min(risks)))
            part = replace(part, fitted={**part.fitted, risk: fitted})
        known = part.boundary(risk)
        assert known is not None
        larger = known.stiffness
    return part


def _tails(
    cases: Sequence[Case],
    region: JointRegion,
    levels: Floats,
    limits: tuple[Floats, ...],
    risk: float,
    draws: int,
) -> tuple[Tail, ...] | None:
    """The lowest limits of every case, or None as soon as one of them cannot say it."""
    found = []
    for case, own, part in zip(cases, limits, region.regions, strict=True):
        tail = lower_tail(case, part, loops_of(case, draws=draws).draws, levels, own, risk)
        if tail is None:
            return None
        found.append(tail)
    return tuple(found)
