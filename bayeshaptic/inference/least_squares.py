"""The deterministic fit: weighted least squares from several starts (the paper's, section III)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.inference.fit import (
    MISFIT,
    Fit,
    ends_at_bounds,
    impossible_at_bounds,
    refuse_unfit,
    runs_away,
    search_box,
    summarise,
    weighted_residuals,
)
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.models.chains import shorter_chain, with_a_mode_moved, with_one_more_mode
from bayeshaptic.models.start import informed, starting_points
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats

# Before a start is in its valley its cost says little of how deep that is, and many of those that
# reach the deepest need more than 15 steps: with 24 starts of 15 steps, one fit in 20 of a held
# Phantom without a device file ended in another valley.
_KEPT_STARTS, _STEPS_TO_A_VALLEY = 48, 40
# Starts that creep reach no better valley: of those of 126 fits 44.5 % reach the deepest that any
# found, 45.4 % without this at a third more responses, 41.4 % with 1e-3.
CREEPS = 1e-4
# Sets of starting points: where a model misfits its valleys are many, and one set of a held LHIfAM
# with a second mode ended in a worse one for one to two seeds in six.
SETS = 4
# Relative steps of cost within a valley: from 0.01 to 0.04 there are as many of them in each of 12
# simulated recordings, most often two or more beside the deepest.
_ONE_VALLEY = 0.02
# In closed loop: of 70 simulated ones most settle in four, some short ones not in twenty.
_REWEIGHINGS, _SETTLED = 20, 0.02
# Half chi-square over the best, of starting points that lead to fits as good: they are not at the
# end of their valleys yet.
_ALIKE = 30.0
_OTHER_VALLEYS = 2  # from which effects are searched for, too: each costs what the fit itself does


@at_the_door
@single_threaded
def least_squares(
    model: Model,
    etfe: Etfe,
    seed: int = 0,
    start: Floats | None = None,
    shorter: Fit | None = None,
    most_sets: int = SETS,
) -> Fit:
    """Fit `model` to `etfe` by weighted least squares from several starts.

    The residual of every window is weighted by the noise that the window itself shows; priors only
    bound the search (at six standard deviations).  The windows are compressed anew around each
    fit, because only the ratio to a good first fit is smooth beside a resonance.  Where the model
    misfits, another set of starting points follows, until two end alike; some of these have a mode
    above half the sampling rate.  Of a chain one mode after the other is looked for elsewhere.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    seed : int
        For the starting points.
    start : ndarray, shape (P,) or (S, P), optional
        Begin here and nowhere else.
    shorter : Fit, optional
        For a chain: what its starting points grow from, where that was fitted before; with whatever
        priors, which only bound a search.
    most_sets : int
        Sets of starting points for a model that misfits.

    Returns
    -------
    Fit

    Raises
    ------
    InputError
        Where the model was given another sampling period than the response has, or `start` has
        not as many parameters as the model.
    """
    refuse_unfit(model, etfe, start)
    model = informed(model, etfe)
    if start is not None:
        return replace(_fit(model, etfe, start), etfe=etfe)
    fit = _fit(model, etfe, _starts(model, etfe, seed, shorter))
    if shorter_chain(model) is not None:
        return replace(_with_modes_moved(fit, etfe, most_sets - 1), etfe=etfe)
    for another in range(1, most_sets):
        if not fit.misfits:
            break
        rng = np.random.default_rng([seed, another])
        # Of a position that is early an image takes up the lead that no delay leaves over.
        images = "delay_s" not in fit.impossible
        other = _fit(model, etfe, starting_points(model, etfe, rng, with_images=images))
        here, there = fit.reduced_chi_square, other.reduced_chi_square
        alike = abs(there - here) < _ONE_VALLEY * here
        if not alike:
            fit, other = (fit, other) if here < there else (other, fit)
        # What lies beside the deepest valley: as both sets saw it, or where the other one ended.
        beside = other.elsewhere if alike else other.theta[None]
        elsewhere = np.concatenate([fit.elsewhere, beside])[:_OTHER_VALLEYS]
        fit = replace(fit, elsewhere=elsewhere)
        if alike:
            break
    return replace(fit, etfe=etfe)


def _fit(model: Model, etfe: Etfe, start: Floats) -> Fit:
    """The best fit from one set of starting points, shape (P,) or (S, P)."""
    blurred = etfe.blurred
    found = refine(model, compress(blurred), start)
    theta = found.theta
    rewindowings = 2
    for _ in range(rewindowings):
        windows = compress(blurred, partial(model.response, theta, measured=True))
        theta = polish(model, windows, theta)
    if blurred is not etfe:
        theta, windows = _sharpened(model, etfe, polish(model, compress(etfe), theta), rewindowings)
    if etfe.direct:
        ways = [_sharpened(model, etfe, way, _REWEIGHINGS) for way in (theta, *found.elsewhere)]
        theta, windows = max(ways, key=lambda way: Likelihood(model, way[1])(way[0][None])[0])
    fit = summarise(model, windows, theta, found.agreeing)
    return replace(fit, elsewhere=found.elsewhere, alike=found.alike)


def _sharpened(
    model: Model, etfe: Etfe, theta: Floats, rewindowings: int
) -> tuple[Floats, Windows]:
    """The fit continued together with the windows around it, where that is needed.

    It is needed beside sharp modes, and where feedback hides the noise.  Valleys of sharp modes are
    narrower than starting points are dense, so that a fit begins without them; then the windows
    themselves tell a pole better than the fit does.  Around a fit that is off by a hundredth of a
    line the windows are many times louder, so that not every step leads to a better fit.  In closed
    loop the noise is what the last fit left.
    """
    tried: list[tuple[float, Floats, Windows]] = []
    for step in range(rewindowings + 1):
        windows = compress(etfe, partial(model.response, theta, measured=True))
        tried.append((float(Likelihood(model, windows)(theta[None])[0]), theta, windows))
        if step > 2 and abs(tried[-1][0] - tried[-2][0]) < _SETTLED:
            break
        if step < rewindowings:
            theta = polish(model, windows, theta)
    _, theta, windows = max(tried, key=lambda one: one[0])
    return theta, windows


def _starts(model: Model, etfe: Etfe, seed: int, known: Fit | None) -> Floats:
    """Where to begin; a chain grows from the fit of the one with a mode less, if it can."""
    shorter, grown = shorter_chain(model), np.empty((0, model.size))
    if shorter is not None:
        if known is None or known.model.names != shorter.names:
            known = least_squares(shorter, etfe, seed=seed)
        grown = with_one_more_mode(shorter, known.theta, model, etfe)
    return grown if len(grown) else starting_points(model, etfe, np.random.default_rng(seed))


def _with_modes_moved(fit: Fit, etfe: Etfe, rounds: int) -> Fit:
    """A chain's fit, or a better one that it leads to with one mode after the other elsewhere."""
    idle, modes = 0, fit.model.structure.modes
    for step in range(rounds * modes):
        if not fit.misfits or idle == modes:
            break
        start = with_a_mode_moved(fit.model, fit.theta, 1 + step % modes, etfe)
        other = _fit(fit.model, etfe, start) if len(start) else fit
        better = other.reduced_chi_square < (1 - _ONE_VALLEY) * fit.reduced_chi_square
        fit, idle = (other, 0) if better else (fit, idle + 1)
    return fit


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


def polish(model: Model, windows: Windows, theta: Floats) -> Floats:
    """The optimum nearest to one vector, shape (P,)."""
    here, low, high = search_box(model)
    residuals = weighted_residuals(Likelihood(model, windows), here)
    phi, _ = minimise(residuals, here.coordinate(theta[None]), low, high, 60, 1e-8)
    return np.asarray(here.natural(phi)[0])


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
    valley = np.append(0, np.cumsum(cost[order][1:] > (1 + _ONE_VALLEY) * cost[order][:-1]))
    _, first, size = np.unique(valley, return_index=True, return_counts=True)
    kept = [i for i in 1 + np.argsort(-size[1:], kind="stable") if size[i] > 1][:_OTHER_VALLEYS]
    return phi[order[first[kept]]]
