"""How the parameters give way to an effect: regression over the posterior's own draws.

With the effect at a certain strength the residuals change by g.  Around the posterior, normal
with covariance C, where the slope of the residuals is J, the parameters move by -C J' g, and what
they do not take up of g has the square g'(I - J C J')g: to first order in the parameters and to any
order in the strength.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.coordinates import Coordinates, sampling_coordinates
from bayeshaptic.inference.fit import real_parts, weighted_residuals
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import Model, NearZero
from bayeshaptic.numerics.gauss_newton import jacobian
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.stability.crossings import find_crossings
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Around:
    """A posterior, as the regression sees it.

    Attributes
    ----------
    model : Model
    windows : Windows
    here : Coordinates
    draws : ndarray, shape (M, P)
        Some of the posterior's, natural values.
    phi : ndarray, shape (M, P)
        The same in the coordinates `here`.
    log_density : ndarray, shape (M,)
        Of the posterior there, in these coordinates, up to a constant.
    centre : ndarray, shape (P,)
        Their mean.
    left : ndarray, shape (N,)
        Residuals at the centre, of unit variance.
    slope : ndarray, shape (N, P)
        Of the residuals there.
    root : ndarray, shape (F, P)
        A root of the covariance, root' root, without the parameters close to an end of their
        support: these stay where they are, so that no draw is pushed beyond it.
    pull : ndarray, shape (F, N)
        root J'.
    """

    model: Model
    windows: Windows
    here: Coordinates
    draws: Floats = field(repr=False)
    phi: Floats = field(repr=False)
    log_density: Floats = field(repr=False)
    centre: Floats = field(repr=False)
    left: Floats = field(repr=False)
    slope: Floats = field(repr=False)
    root: Floats = field(repr=False)
    pull: Floats = field(repr=False)

    @property
    def theta(self) -> Floats:
        """The centre in natural values, shape (P,)."""
        return np.asarray(self.here.natural(self.centre[None])[0])

    @cached_property
    def log_limit(self) -> Floats:
        """ln K_CR of the draws, shape (M,)."""
        return log_limits(self.model, self.draws)

    def natural(self, phi: Floats) -> Floats:
        """Natural values at `phi`, (B, P); where steps went too far, infinite ones."""
        with np.errstate(over="ignore"):
            return self.here.natural(phi)

    def changes(self, model: Model, vectors: Floats, moved: Floats | None = None) -> Floats:
        """Change g of the residuals, (C, N): of extended `model` at (C, P').

        With the parameters `moved`, (C, P), what the slope does not account for.
        """
        with np.errstate(all="ignore"):
            left = Likelihood(model, self.windows).normalised(vectors)
            found = real_parts(left) - self.left
        if moved is not None:
            found -= moved @ self.slope.T
        impossible = 1e6
        return np.where(np.isfinite(found), found, impossible)

    def log_prior(self, phi: Floats) -> Floats:
        """Log prior density in `here` at points (B, P) of its support, (B,)."""
        with np.errstate(all="ignore"):  # far-away points may overflow
            return self.model.log_prior(self.here.natural(phi)) + self.here.log_jacobian(phi)

    def density(self, model: Model, vectors: Floats, phi: Floats) -> Floats:
        """Log posterior density in `here`, (B,): of extended `model` with the base at `phi`."""
        value = np.full(len(phi), -np.inf)
        inside = self.here.inside(phi)
        if not inside.any():
            return value
        with np.errstate(all="ignore"):  # far-away vectors may overflow
            value[inside] = self.log_prior(phi[inside]) + Likelihood(model, self.windows)(
                vectors[inside]
            )
        return np.where(np.isfinite(value), value, -np.inf)

    def power(self, changes: Floats) -> Floats:
        """Squares of what the parameters cannot take up, shape (C,)."""
        absorbed = self.taken_up(changes)
        power = np.einsum("cn,cn->c", changes, changes) - np.einsum("cf,cf->c", absorbed, absorbed)
        return np.maximum(power, 0.0)

    def moved(self, changes: Floats) -> Floats:
        """How far the parameters give way, in `here`, shape (C, P); no further than makes sense."""
        there = self.centre - self.taken_up(changes) @ self.root
        least, most = 1e-3, 30.0  # times its value: no parameter gives way further than that
        far = np.abs(self.centre) * np.array([[least], [most]])
        low = np.where(self.here.log, self.centre - np.log(most), np.maximum(far[0], self.here.low))
        high = np.where(self.here.log, self.centre + np.log(most), far[1])
        return np.clip(there, np.minimum(low, self.centre), high) - self.centre

    def close(self, one: Floats, other: Floats) -> bool:
        """Whether the residuals hardly tell the moves of all cases, (C, P), from others."""
        apart = np.sum(((one - other) @ self.slope.T) ** 2, axis=1)
        return bool(np.all(apart < 1e-3))

    def taken_up(self, changes: Floats) -> Floats:
        """What the parameters take up of changes, (C, N), in independent directions; (C, F)."""
        return changes @ self.pull.T


def log_limits(model: Model, vectors: Floats) -> Floats:
    """ln K_CR of parameter vectors (B, P); -inf where never stable, inf where nothing limits it."""
    assert model.period_s is not None
    with np.errstate(divide="ignore"):
        return np.log(find_crossings(model.system(vectors), model.period_s).critical)


def around(posterior: Posterior, count: int, rng: np.random.Generator) -> Around:
    """The regression of a posterior that was sampled from windows, over `count` draws."""
    model, windows = posterior.model, posterior.windows
    assert windows is not None
    every = posterior.draws
    draws = every[rng.permutation(len(every))[: min(count, len(every))]]
    here = sampling_coordinates(model, draws.mean(axis=0), draws.std(axis=0))
    likelihood = Likelihood(model, windows)
    phi = here.coordinate(draws)
    centre = phi.mean(axis=0)
    residuals = weighted_residuals(likelihood, here)
    left = residuals(centre[None])[0]
    slope = jacobian(residuals, centre[None])[0]
    curvature = _curvature(model, here, centre, phi.std(axis=0))
    root = _root(slope, curvature, ~_near_an_end(model, here, phi))
    nothing = np.zeros(len(draws))
    known = here, draws, phi, nothing, centre, left, slope, root, root @ slope.T
    found = Around(model, windows, *known)
    return replace(found, log_density=found.density(model, draws, phi))


def _near_an_end(model: Model, here: Coordinates, phi: Floats) -> NDArray[np.bool_]:
    """Which parameters lie close to the lower end of their support, shape (P,)."""
    ends = here.walls | np.array([isinstance(model.prior(n), NearZero) for n in model.names])
    with np.errstate(invalid="ignore"):
        room = phi.mean(axis=0) - here.low
    close = 3.0  # standard deviations from the end: further away a parameter may be moved
    return ends & (room < close * phi.std(axis=0))


def _root(slope: Floats, curvature: Floats, free: NDArray[np.bool_]) -> Floats:
    """A root of the covariance of the free coordinates, the others taken as known, shape (F, P).

    It is made from slope and prior and not from the draws: what an effect and the parameters share
    may be a hundred standard deviations, and the covariance of some hundred draws is right to some
    per cent only.
    """
    normal = slope[:, free].T @ slope[:, free] + np.diag(curvature[free])
    scale = 1 / np.sqrt(np.diag(normal))
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    out = np.zeros((int(free.sum()), len(free)))
    ridge = 1e-12
    out[:, free] = (vectors / np.sqrt(np.maximum(values, ridge))).T * scale
    return out


def _curvature(model: Model, here: Coordinates, centre: Floats, spread: Floats) -> Floats:
    """Downward curvature of the log prior at the centre, shape (P,); zero where it bends up."""
    steps = np.concatenate([np.zeros((1, len(centre))), np.diag(spread), -np.diag(spread)])
    points = centre + 0.5 * steps
    with np.errstate(all="ignore"):
        value = model.log_prior(here.natural(points)) + here.log_jacobian(points)
        bend = (value[1 : len(centre) + 1] + value[len(centre) + 1 :] - 2 * value[0]) / (
            0.5 * spread
        ) ** 2
    return np.where(np.isfinite(bend), np.maximum(-bend, 0.0), 0.0)
