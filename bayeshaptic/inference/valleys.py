"""Where starting points of a fit end: its valleys, and the deepest of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.fit import (
    MISFIT,
    ends_at_bounds,
    impossible_at_bounds,
    runs_away,
    search_box,
    weighted_residuals,
)
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.models.start import starting_points
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats

# Before a start is in its valley its cost says little of how deep that is, and many of those that
# reach the deepest need more than 15 steps: with 24 starts of 15 steps, one fit in 20 of a held
# Phantom without a device file ended in another valley.
_KEPT_STARTS, _STEPS_TO_A_VALLEY = 48, 40
# Starts that creep reach no better valley: of those of 126 fits 44.5 % reach the deepest that any
# found, 45.4 % without this at a third more responses, 41.4 % with 1e-3.
CREEPS = 1e-4
# Relative steps of cost within a valley: from 0.01 to 0.04 there are as many of them in each of 12
# simulated recordings, most often two or more beside the deepest.
ONE_VALLEY = 0.02
# Starting points lead to fits as good as the best where their half chi-square is at most this far
# above it: they are not at the end of their valleys yet.
_ALIKE = 30.0
OTHER_VALLEYS = 2  # from which effects are searched for, too: each costs what the fit itself does


@dataclass(frozen=True)
class Optimum:
    """Where starting points ended.

    Attributes
    ----------
    theta : ndarray, shape (P,)
        The best.
    agreeing : int
        How many of those refined to the end found the same optimum.
    elsewhere : ndarray, shape (V, P)
        The best points of the other valleys in which several ended, that with most of them first.
    alike : ndarray, shape (A, P)
        Points in valleys about as deep, the best first, not at their ends.
    reduced_chi_square : float
    impossible : tuple of str
        As of a `Fit`.
    """

    theta: Floats
    agreeing: int
    elsewhere: Floats
    alike: Floats
    reduced_chi_square: float
    impossible: tuple[str, ...] = ()

    @property
    def explains(self) -> bool:
        """Whether it leaves noise, and no mass has run away."""
        return self.reduced_chi_square <= MISFIT and not runs_away(self.impossible)

    def as_deep_as(self, other: Optimum) -> bool:
        """Whether another one is no deeper, but for what points of one valley differ by."""
        return other.reduced_chi_square > (1 - ONE_VALLEY) * self.reduced_chi_square


def refine(model: Model, windows: Windows, start: Floats) -> Optimum:
    """The best fit to `windows` from many starting vectors, shape (S, P).

    Of the optima found, that with the highest posterior density: masses may swap their parts in
    the motion and fit as well, and the priors tell which is which.
    """
    here, low, high = search_box(model)
    residuals = weighted_residuals(Likelihood(model, windows), here)
    phi = np.clip(here.coordinate(np.atleast_2d(start)), low, high)

    def penalty(phi: Floats) -> Floats:
        return -model.log_prior(here.natural(phi)) - here.log_jacobian(phi)

    phi, cost = _valleys(residuals, phi, low, high)
    elsewhere = here.natural(_other_valleys(phi, cost))
    alike = here.natural(phi[np.argsort(cost)][: np.sum(cost < cost.min() + _ALIKE)])
    refined = 6  # of them converged to the end
    phi = phi[np.argsort(cost + penalty(phi))[:refined]]
    phi, cost = minimise(residuals, phi, low, high, steps=100, tolerance=1e-3)
    best = np.argmin(cost + penalty(phi))
    agreeing = int(np.sum(cost < cost[best] + 0.5))
    left = float(cost[best] / windows.target.size)
    ends = np.array(model.names)[ends_at_bounds(phi[best], low, high)]
    impossible = impossible_at_bounds(model, ends.tolist())
    return Optimum(here.natural(phi)[best], agreeing, elsewhere, alike, left, impossible)


def refine_anew(model: Model, etfe: Etfe, windows: Windows, start: Floats) -> Optimum:
    """`refine`, and from starting points of the model's own where that leaves more than noise."""
    found = refine(model, windows, start)
    return anew(model, etfe, windows, found) or found


def anew(model: Model, etfe: Etfe, windows: Windows, found: Optimum | None) -> Optimum | None:
    """What starting points of the model's own lead to, or `found` where that is as good.

    A fit without an effect may be bent so far that no value of the effect beside it leads on.  For
    a second mode on the motor of a held LHIfAM without a device file none of ten fits led on, while
    starting points that no fit has bent led there in nine of ten.  Both kinds in one set would
    crowd each other out.  Models with dynamic links are left out, because so many responses would
    be dear (not measured).  Where more than this effect is lacking, a valley that is a little
    deeper may only be bent in another way: the other one must halve what is left, or keep its
    masses where those of `found` ran away.
    """
    if found is not None and found.explains:
        return found
    start = starting_points(model, etfe, np.random.default_rng(0))
    if not model.system(start[:1]).rational:
        return found
    other = refine(model, windows, start)
    better = found is None or 2 * other.reduced_chi_square < found.reduced_chi_square
    return other if better or other.explains else found


def _valleys(
    residuals: Callable[[Floats], Floats], phi: Floats, low: Floats, high: Floats
) -> tuple[Floats, Floats]:
    """Sift the starting points and lead the better ones into their valleys."""
    with np.errstate(all="ignore"):
        cost = np.einsum("bn,bn->b", *(2 * [residuals(phi)]))
    phi = phi[np.argsort(np.where(np.isfinite(cost), cost, np.inf))[:_KEPT_STARTS]]
    return minimise(residuals, phi, low, high, _STEPS_TO_A_VALLEY, 1e-2, CREEPS)


def _other_valleys(phi: Floats, cost: Floats) -> Floats:
    """The best points of valleys other than the deepest, where several starting points lie.

    Points of one valley differ little in their cost.
    """
    order = np.argsort(cost)
    valley = np.append(0, np.cumsum(cost[order][1:] > (1 + ONE_VALLEY) * cost[order][:-1]))
    _, first, size = np.unique(valley, return_index=True, return_counts=True)
    kept = [i for i in 1 + np.argsort(-size[1:], kind="stable") if size[i] > 1][:OTHER_VALLEYS]
    return phi[order[first[kept]]]
