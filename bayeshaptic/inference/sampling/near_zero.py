"""Coordinates for parameters of which a recording says no more than that they are next to zero.

The prior `NearZero` has as much probability on every scale, `MaybeZero` a spike, and a damper of
which nobody knows anything may be a hundredth of what it seems: only a logarithm shows all of it.
But what the data know, sums of dampers before all, are lines in the natural values, hundreds of
times longer than they are thick, and a logarithm would bend them.  So the other coordinates are
measured from where they follow the small one to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.coordinates import Coordinates, is_wide, sampling_coordinates
from bayeshaptic.inference.fit import Fit, weighted_residuals
from bayeshaptic.models import MaybeZero, NearZero, Prior, draw
from bayeshaptic.numerics.gauss_newton import jacobian, root_of_covariance
from bayeshaptic.numerics.truncated_normal import spread_above
from bayeshaptic.types import Floats

Redraw = Callable[[Floats, np.random.Generator], tuple[Floats, Floats]]
"""From points (B, P) to proposed points, with log density of proposing the way back over there."""
_MAY_BE_ZERO = (MaybeZero, NearZero)  # priors
# A parameter that is this many standard deviations from zero is sampled as it is: one that may be
# zero, and one whose size no prior knows, of whose posterior 2 % lie next to zero then.
_SEEN, _SEEN_WIDE = 5.0, 3.5
# Longest ridge that counts as straight, in coordinate units: e^10 in a logarithm.  It is a guard:
# the ridges of 12 simulated recordings, held and free, clean and with effects, are all shorter than
# 1.
_LONGEST = 10.0


def with_near_zero(here: Coordinates, fit: Fit) -> Coordinates:
    """`here` with logarithms for the parameters next to zero that `fit` does not see.

    How the others follow them is the direction in which the fit suffers least.  Of several whose
    sum is seen, these are measured by their ratios to the largest.
    """
    found = _candidates(here, fit)
    if not found:
        return here
    slope = _slope(here, fit)
    values = fit.theta / here.scale
    far = values / _errors(slope)
    found = {index: prior for index, prior in found.items() if far[index] < _enough(prior)}
    rising = sorted(found, key=lambda index: values[index])
    beside, small = _split(slope, values, found, rising)
    # What follows further than makes sense; then the largest may be far from zero.
    while small and np.abs(_followed(slope, small) @ values[small]).max() > _LONGEST:
        rising = [index for index in rising if index != small[-1]]
        # What is not small follows the others anew.
        beside, small = _split(slope, values, found, rising)
    if not small:
        return here
    small = sorted(small)
    chosen = np.isin(np.arange(len(values)), small)
    return replace(
        here,
        log=here.log | chosen,
        scale=np.where(chosen, 1.0, here.scale),
        low=np.where(chosen, 0.0, here.low),
        high=np.where(chosen, np.inf, here.high),
        walls=here.walls & ~chosen & (np.arange(len(values)) != beside),
        near_zero=tuple(small),
        floor=np.array([_floor(found[index]) for index in small]),
        follow=_followed(slope, small) / here.scale[small],
        beside=beside,
        beside_floor=1.0 if beside is None else _floor(found[beside]),
    )


def _candidates(here: Coordinates, fit: Fit) -> dict[int, Prior]:
    """Parameters that may be next to zero, by their place: by their priors, and by their errors.

    The latter are dampers that are sampled as they are, but whose prior lets them be as small as
    they like: where one is two of its errors a third of the posterior may lie next to zero, a
    needle at the wall.
    """
    found: dict[int, Prior] = {}
    for index, name in enumerate(fit.model.names):
        prior, damps = fit.model.prior(name), fit.model.parameter(name).dimension == "damping"
        if isinstance(prior, _MAY_BE_ZERO) or (is_wide(prior) and damps and not here.log[index]):
            found[index] = prior
    return found


def _enough(prior: Prior) -> float:
    """Standard deviations from zero, from which on a parameter is sampled as it is."""
    return _SEEN if isinstance(prior, _MAY_BE_ZERO) else _SEEN_WIDE


def _floor(prior: Prior) -> float:
    """Below that every value is alike."""
    if isinstance(prior, _MAY_BE_ZERO):
        return prior.floor
    lowest = 1e-3  # of the probability
    return float(prior.quantile(lowest))


def resolved(fit: Fit) -> Fit:
    """`fit` with priors that know how well it sees those parameters that may be zero."""
    priors = {name: fit.model.prior(name) for name in fit.model.names}
    open_ = {n: p for n, p in priors.items() if isinstance(p, MaybeZero) and p.seen is None}
    if not open_:
        return fit
    here = sampling_coordinates(fit.model, fit.theta, fit.sd)
    seen = dict(zip(fit.model.names, _room(here, fit) * here.scale, strict=True))
    known = {name: replace(prior, seen=float(seen[name])) for name, prior in open_.items()}
    return replace(fit, model=fit.model.with_prior(known))


def _room(here: Coordinates, fit: Fit) -> Floats:
    """Standard deviations of coordinates, shape (P,), no more than walls leave room for.

    Of two dampers whose sum alone is known each may be anything up to that, and no more.  What
    walls leave is the deviation of the normal distribution that they cut off, in those of half a
    normal: that is what is left of one beside its own wall.  Where every axis leads out of a corner
    of walls, nothing is drawn beside the corner, and the deviations stand.
    """
    root = root_of_covariance(_slope(here, fit))
    errors = np.linalg.norm(root, axis=1)
    walled = ~here.log & (here.low == 0)
    if walled.any():
        values, draws = fit.theta[walled] / here.scale[walled], 1000
        left = spread_above(here.low[walled], values, root[walled], draws)
        half = np.sqrt(1 - 2 / np.pi)
        errors[walled] = np.where(left > 0, np.minimum(errors[walled], left / half), errors[walled])
    return np.asarray(errors)


def _slope(here: Coordinates, fit: Fit) -> Floats:
    """Of residuals of unit variance, misfit included, shape (N, P)."""
    residuals = weighted_residuals(fit.likelihood, here)
    slope = jacobian(residuals, here.coordinate(fit.theta)[None])[0]
    return slope / np.sqrt(max(1.0, fit.reduced_chi_square))


def _split(
    slope: Floats, values: Floats, found: dict[int, Prior], rising: list[int]
) -> tuple[int | None, list[int]]:
    """Which are small, and one that is seen beside them because their sum is.

    The smallest first: those follow that are not seen where the ones so far are given.
    """
    small: list[int] = []
    for index in rising:
        if values[index] < _enough(found[index]) * _errors(_given(slope, small))[index]:
            small.append(index)
    if not small:
        return None, small
    follow, errors = _followed(slope, small), _errors(_given(slope, small))
    beside, nearest = None, np.inf
    for index in rising:
        whole = values[index] - follow[index] @ values[small]
        if index in small or not (follow[index] < 0).all() or whole <= _SEEN * errors[index]:
            continue
        end = whole / -follow[index].min()  # of the small one that takes most of it
        if end < nearest:
            beside, nearest = index, end
    return beside, small


def _given(slope: Floats, small: list[int]) -> Floats:
    """The slopes where the small ones are known."""
    known = slope.copy()
    known[:, small] = 0.0
    return known


def _errors(slope: Floats) -> Floats:
    """Standard deviations of coordinates, shape (P,), those without a slope aside."""
    return np.asarray(np.linalg.norm(root_of_covariance(slope), axis=1))


def _followed(slope: Floats, small: list[int]) -> Floats:
    """How far the others move for each unit of the small ones, shape (P, len(small))."""
    others = np.setdiff1d(np.arange(slope.shape[1]), small)
    known = slope[:, others].T @ slope[:, others] + np.eye(len(others))
    follow = np.zeros((slope.shape[1], len(small)))
    follow[others] = -np.linalg.solve(known, slope[:, others].T @ slope[:, small])
    return follow


def start_of(here: Coordinates, fit: Fit) -> Floats:
    """The fit in the coordinates `here`, shape (P,), inside the support.

    The small ones begin at a quantile of their priors, because zero is an end: at one where the
    data are not yet against it by more than they are against draws of the posterior, or, where
    priors lie far above all that the data allow, as near to zero as a fit may go.
    """
    lost = len(fit.theta)  # log likelihood; half of it is what draws lose
    quantiles = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-5, 1e-7, 1e-9)
    for begin in quantiles:
        phi = inside(here, fit, begin)
        if np.isfinite(phi).all():
            with np.errstate(all="ignore"):  # what follows the small ones far away may overflow
                found = fit.likelihood(here.natural(phi[None]))[0]
            if found > fit.log_likelihood - lost:
                break
    return phi


def inside(here: Coordinates, fit: Fit, begin: float = 0.0) -> Floats:
    """The fit in coordinates, (P,), inside the support, small parameters at a quantile or above."""
    phi = here.coordinate(fit.theta)
    inner = fit.theta.copy()
    for index in (*here.near_zero, *(() if here.beside is None else (here.beside,))):
        least = float(_on_every_scale(fit.model.prior(fit.model.names[index])).quantile(begin))
        inner[index] = max(inner[index], least)
    small = list(here.near_zero)
    phi[small] = here.coordinate(inner)[small]  # the others follow
    # One that follows to beyond its own end, a delay of nothing say, stays at that.
    own = here.own(phi)
    margin = 1e-6  # of a prior's width, or of a logarithm
    return phi + np.clip(own, here.low + margin, here.high - margin) - own


def _on_every_scale(prior: Prior) -> Prior:
    """A density that is nowhere far from `prior` next to zero, whichever scale the data see."""
    if isinstance(prior, MaybeZero):
        return NearZero(prior.scale, max(prior.floor, 1e-12 * prior.scale))
    return prior


def reached(here: Coordinates, theta: Floats) -> NDArray[np.bool_]:
    """Which vectors, shape (B, P), lie where the small ones are small; shape (B,).

    Where one is not, the others would be measured from far away.
    """
    small = theta[:, list(here.near_zero)]
    return np.asarray(np.all(np.abs(small @ here.follow.T) < _LONGEST, axis=1))


def redrawing(here: Coordinates, fit: Fit) -> Redraw | None:
    """A proposal of small parameters on every scale, the others held where they are.

    Where the data prefer a little to nothing, there is a hump beside the plateau next to zero, and
    mixtures of a few components leave out corners of the plateau.
    """
    if here.beside is not None:
        return _redrawing_ratios(here)
    if not here.near_zero:
        return None
    priors = [_on_every_scale(fit.model.prior(fit.model.names[i])) for i in here.near_zero]

    def log_density(phi: Floats) -> Floats:
        theta = here.natural(phi)
        columns = zip(here.near_zero, priors, strict=True)
        return np.sum([p.log_density(theta[:, i]) + phi[:, i] for i, p in columns], axis=0)

    def propose(phi: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        theta = np.stack([draw(prior, rng, len(phi)) for prior in priors], axis=1)
        drawn = phi.copy()
        drawn[:, here.near_zero] = np.log1p(theta / here.floor)
        return drawn, log_density(phi) - log_density(drawn)

    return propose


def _redrawing_ratios(here: Coordinates) -> Redraw:
    """A proposal of log ratios anywhere between their ends, which the sum gives, and that stays."""

    def propose(phi: Floats, rng: np.random.Generator) -> tuple[Floats, Floats]:
        low, high = here.ends_of_ratios(phi)
        drawn = phi.copy()
        drawn[:, here.near_zero] = rng.uniform(low, high)
        return drawn, np.zeros(len(phi))

    return propose
