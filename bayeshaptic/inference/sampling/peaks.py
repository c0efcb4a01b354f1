"""Ensembles about every peak that the fit found: a device may have more than one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.fit import Fit, search_box, weighted_residuals
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.ensembles import Ensembles, joined, warmed_up
from bayeshaptic.inference.sampling.laplace import laplace
from bayeshaptic.inference.sampling.near_zero import Redraw, reached, start_of
from bayeshaptic.inference.sampling.proposal import Proposal
from bayeshaptic.inference.sampling.several_peaks import covered, log_held, log_mean, log_weights
from bayeshaptic.numerics.gauss_newton import minimise
from bayeshaptic.numerics.mixture import StudentMixture
from bayeshaptic.types import Floats, LogDensity

# With these numbers 90 % intervals hold 216 of 264 parameters and 21 of 24 limits of held PHANToMs
# without a file (values changed by e^0.8, 12 s); about one peak alone they hold 190 and 19. With
# half or twice as many peaks or idle ones, and half or twice of what is slight or fits about as
# well (`inference/valleys.py`), they hold 216 to 218 and 19 to 22.
_MOST = 6  # peaks
_IDLE = 2  # that turn out to be none, after which no more are looked for
_SHARED = 0.5  # of walkers that lie where others have been: it is their peak
_LOOKED_AT = 12  # ends of the fit, by their densities
# A peak is left out where the log of its probability is this far below the largest: by its own
# draws, and by Laplace's approximation, which misses most of a bent peak.
_SLIGHT, _TOO_SLIGHT = 7.0, 14.0


def warmed_up_about_peaks(
    counted: LogDensity,
    density: Density,
    origin: Floats,
    fit: Fit,
    seed: np.random.SeedSequence,
    redraw: Redraw | None,
    most_steps: float,
) -> Ensembles[Any]:
    """Ensembles that are warmed up, about the fit and about all that fits as well.

    Masses of a held device may swap their parts in the motion and fit as well: ensembles that all
    begin about one peak agree with one another that there is no other.

    Parameters
    ----------
    counted : callable
        The density, as it is to be called.
    density : Density
    origin : ndarray, shape (P,)
        The fit, in sampling coordinates.
    fit : Fit
    seed : SeedSequence
    redraw : callable, optional
    most_steps : float
        After which no more is warmed up.
    """
    peak, first = laplace(density, origin)
    found = [warmed_up(counted, first, seed, peak, redraw, most_steps)]
    held = [log_held(counted, found[0].proposal)]
    idle = 0
    for one in _candidates(counted, density, fit, found[0]):
        if len(found) == _MOST or idle == _IDLE or one.held < max(held) - _TOO_SLIGHT:
            break
        if _share_covered(found, one.best) > _SHARED:
            continue
        (own,) = seed.spawn(1)
        about = warmed_up(counted, one.proposal, own, one.peak, redraw, most_steps / _MOST)
        share = log_held(counted, about.proposal)
        idle += 1
        if share > max(held) - _SLIGHT and _share_covered(found, about.positions) < _SHARED:
            found.append(about)
            held.append(share)
            idle = 0
    kept = [index for index, share in enumerate(held) if share > max(held) - _SLIGHT]
    if len(kept) == 1:
        return found[kept[0]]
    (last,) = seed.spawn(1)
    return joined(counted, [found[i] for i in kept], np.array([held[i] for i in kept]), last)


@dataclass(frozen=True)
class _Candidate:
    """Laplace's approximation around a peak; how much it holds, and the best of some draws."""

    peak: Floats
    proposal: StudentMixture
    held: float
    best: Floats


def _candidates(
    counted: LogDensity, density: Density, fit: Fit, own: Ensembles[Proposal]
) -> list[_Candidate]:
    """Peaks about which one might warm up, those that seem to hold the most first."""
    found = []
    for start in _others(density, fit, own)[:_LOOKED_AT]:
        peak, first = laplace(density, start)
        draws = first.sample(np.random.default_rng(0), 200)
        weights = log_weights(counted(draws), first.log_density(draws))
        best = draws[np.argsort(weights)[-20:]]
        found.append(_Candidate(peak, first, log_mean(weights), best))
    return sorted(found, key=lambda one: one.held, reverse=True)


def _share_covered(found: list[Ensembles[Proposal]], points: Floats) -> float:
    """Of points, shape (B, P), the share that the proposal draws which draws the most of them."""
    return max(float(covered(one.proposal, points).mean()) for one in found)


def _others(density: Density, fit: Fit, own: Ensembles[Proposal]) -> list[Floats]:
    """Where else the fit ends as well, in sampling coordinates, the likelier ones first."""
    here = density.coordinates
    away = fit.alike
    if len(away):
        away = away[~covered(own.proposal, here.coordinate(away))]
    if not len(away):
        return []
    box, low, high = search_box(fit.model)
    residuals = weighted_residuals(fit.likelihood, box)
    steps, settled = 60, 1e-3
    phi, _ = minimise(residuals, box.coordinate(away), low, high, steps, settled)
    theta = box.natural(phi)
    ends = [_at(here, fit, one) for one in theta[reached(here, theta)]]
    values = [float(density(end)[0]) for end in ends]
    return [ends[index] for index in np.argsort(values)[::-1] if np.isfinite(values[index])]


def _at(here: Coordinates, fit: Fit, theta: Floats) -> Floats:
    own = float(fit.likelihood(theta[None])[0])
    return start_of(here, replace(fit, theta=theta, log_likelihood=own))
