"""The lowest limits over damping among more draws than it would pay to look at one by one.

A small risk needs tens of thousands of draws, and only the lowest limits of them.  A quadratic
function of the parameters, fitted to the draws that were looked at, says which of the others may be
among these; those are looked at, too.  Nothing that is stated comes from the function itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.stability.tail import ENOUGH_BELOW
from bayeshaptic.stability.walls.region import KbRegion, region_of_draws
from bayeshaptic.types import Floats

_LOW = 0.3  # of the draws that were looked at: those with the lowest limits are fitted


@dataclass(frozen=True)
class Tail:
    """The lowest limits of a case.

    Attributes
    ----------
    region : KbRegion
        Of the draws that may have them.
    limits : ndarray, shape (m, J)
        Their limits at each damping of a table, each column in ascending order.
    ends : ndarray, shape (m,)
        The dampings where their regions end, ascending.
    total : int
        Number of draws that they are the lowest of.
    risk : float
        Up to which none is missing.
    """

    region: KbRegion = field(repr=False)
    limits: Floats = field(repr=False)
    ends: Floats = field(repr=False)
    total: int
    risk: float

    def at(self, levels: Floats) -> Tail:
        """The same at other dampings."""
        return replace(self, limits=np.sort(self.region.limits(levels), axis=0))


def lower_tail(
    case: Any, some: KbRegion, draws: Floats, levels: Floats, limits: Floats, risk: float
) -> Tail | None:
    """The lowest limits of a case at dampings `levels`; None where its draws do not allow it.

    Parameters
    ----------
    case : Case
    some : KbRegion
        Of some of its draws.
    draws : ndarray, shape (n, P)
        Those.
    levels : ndarray, shape (J,)
    limits : ndarray, shape (n, J)
        Their limits.
    risk : float
        Down to which quantiles are wanted.
    """
    samples = case.limit.samples
    if len(samples) != len(case.draws) or case.limit.effective_below(risk) < ENOUGH_BELOW:
        return None
    most = 24_000  # draws in all: 24 below 0.1 %
    index = np.linspace(0, len(samples) - 1, min(len(samples), most)).astype(int)
    possible = np.all(limits > 0, axis=0)  # near the ends the ends themselves tell
    columns = np.column_stack([limits[:, possible], some.largest_damping()])
    found = _candidates(draws, columns, case.draws[index], risk)
    if found is None:
        return None
    chosen, safe = found
    place = int(np.ceil(risk * len(index)))
    if len(chosen) <= place:  # as where no draw has a stable wall: none is below the others
        return None
    region = region_of_draws(
        case.model, case.draws[index][chosen], some.kind, samples[index][chosen]
    )
    ends = np.sort(region.largest_damping())
    tail = Tail(region, np.empty((0, 0)), ends, len(index), risk).at(levels)
    reached = np.append(tail.limits[place, possible], ends[place])
    return None if np.any(reached > safe) else tail  # some of the lowest may be missing


def _candidates(
    draws: Floats, limits: Floats, every: Floats, risk: float
) -> tuple[NDArray[np.int_], Floats] | None:
    """Which of `every` may be among the lowest, and up to which limit none is missed, (J,)."""
    middle, width = draws.mean(axis=0), draws.std(axis=0)
    width = np.where(width > 0, width, 1.0)
    basis, every_basis = (_quadratic((part - middle) / width) for part in (draws, every))
    if _LOW * len(draws) < 2 * basis.shape[1]:
        return None
    predicted, error = np.empty((len(every), limits.shape[1])), np.empty(limits.shape[1])
    for level, column in enumerate(limits.T):
        low = np.argsort(column)[: int(_LOW * len(column))]  # the tail has its own slope
        coefficients = np.linalg.lstsq(basis[low], column[low], rcond=None)[0]
        predicted[:, level] = every_basis @ coefficients
        error[level] = (column[low] - basis[low] @ coefficients).std()
    reach = 3.0  # times the risk: how far up the predicted tail is looked at
    margin = 4.0  # and standard deviations of the prediction's error more
    edge = np.quantile(predicted, reach * risk, axis=0) + margin * error
    chosen = np.flatnonzero(np.any(predicted < edge, axis=1))
    looked_at = 6000
    return (chosen, edge - margin * error) if len(chosen) <= looked_at else None


def _quadratic(scores: Floats) -> Floats:
    """1, each column, and each product of two, shape (n, 1 + P + P (P + 1) / 2)."""
    first, second = np.triu_indices(scores.shape[1])
    products = scores[:, first] * scores[:, second]
    return np.concatenate([np.ones((len(scores), 1)), scores, products], axis=1)
