"""The coordinates in which parameters are fitted and sampled.

Positive parameters are known up to a factor and go in as logarithms.  Dampers to the ground may be
zero: they stay linear, with a wall at zero, because every coordinate that pushes the wall away to
infinity mixes badly there.  Other dampers, and masses, too, are sampled as they are where they are
known roughly: the data know their sums best, and only so the ridges along them are straight.
Dampers that a device file gives as zero are a matter of their own: see `near_zero`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models import LogNormal, Model, Prior
from bayeshaptic.types import Floats

_SUMS = ("mass", "damping")  # quantities whose sums the data know best
_KNOWN = 0.8  # log standard deviation, of prior and data together, below which one is known
_WIDE = 1.0  # log standard deviation of a prior that does not know how large a damper is


@dataclass(frozen=True)
class Coordinates:
    """A map between natural values theta and coordinates phi, both of shape (B, P).

    Attributes
    ----------
    log : ndarray of bool, shape (P,)
        Where phi = log(theta); elsewhere phi = theta / scale.
    scale : ndarray, shape (P,)
    low, high : ndarray, shape (P,)
        The support of the priors, in phi.
    walls : ndarray of bool, shape (P,)
        Which parameters have a wall at the low end that the posterior may lean on.
    near_zero : tuple of int
        Which of those in logarithms may be zero: phi = log(1 + theta / floor).
    floor : ndarray, shape (len(near_zero),)
    beside : int or None
        One that may be zero as well, but not at once with these, because their sum is known: phi of
        these is less by log(1 + theta / floor) of that one, a log ratio of shares with both ends.
    beside_floor : float
    follow : ndarray, shape (P, len(near_zero))
        How far the others move for each unit of these, along ridges that are straight in natural
        values and would not be in logarithms: phi of the others is what is left.
    """

    log: NDArray[np.bool_]
    scale: Floats
    low: Floats
    high: Floats
    walls: NDArray[np.bool_]
    near_zero: tuple[int, ...] = ()
    floor: Floats = field(default_factory=lambda: np.zeros(0))
    follow: Floats = field(default_factory=lambda: np.zeros((0, 0)), repr=False)
    beside: int | None = None
    beside_floor: float = 1.0

    @property
    def lowest(self) -> Floats:
        """Where each coordinate ends below, shape (P,); -inf of a logarithm."""
        return np.where(self.log, -np.inf, self.low)

    def natural(self, phi: Floats, own: Floats | None = None) -> Floats:
        """Theta; `own` of the same phi where it is known, here and below."""
        own = self.own(phi) if own is None else own
        with np.errstate(over="ignore"):  # far outside, where the density is none
            theta = own * self.scale
            theta[..., self.log] = np.exp(own[..., self.log])
        if self.near_zero:
            theta[..., self.near_zero] = self._small(phi)
        return theta

    def coordinate(self, theta: Floats) -> Floats:
        positive = np.where(self.log, np.maximum(theta, 1e-300), 1.0)
        phi = np.where(self.log, np.log(positive), theta / self.scale)
        if self.near_zero:
            small = theta[..., self.near_zero]
            phi[..., self.near_zero] = np.log1p(small / self.floor)
            if self.beside is not None:
                other = np.log1p(theta[..., [self.beside]] / self.beside_floor)
                phi[..., self.near_zero] -= other
            phi -= small @ self.follow.T
        return phi

    def _small(self, phi: Floats) -> Floats:
        largest = 100.0  # logarithm: what follows something as large as that is far outside anyway
        logarithm = np.minimum(phi[..., self.near_zero], largest)
        if self.beside is None:
            return self.floor * np.expm1(logarithm)
        factor = np.exp(logarithm)
        # Both the sum with the other one and the ratios to it are known: a linear equation.
        left = self.scale[self.beside] * phi[..., [self.beside]]
        grown = (self.floor * factor) @ self._given_up[:, None]
        whole = left + self.beside_floor + self.floor @ self._given_up
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # far outside
            return self.floor * (factor * whole / (self.beside_floor + grown) - 1)

    @property
    def _given_up(self) -> Floats:
        """What the one beside has less for each unit of the small ones, (len(near_zero),)."""
        assert self.beside is not None
        return -self.scale[self.beside] * self.follow[self.beside]

    def ends_of_ratios(self, phi: Floats) -> tuple[Floats, Floats]:
        """Log ratios where the small ones are zero, (B, 1), and the one beside, (B, n)."""
        assert self.beside is not None
        whole = np.maximum(self.scale[self.beside] * phi[:, [self.beside]], 0.0)
        return -np.log1p(whole / self.beside_floor), np.log1p(whole / self._given_up / self.floor)

    def own(self, phi: Floats) -> Floats:
        """Of each parameter by itself: its logarithm, or its value over the scale."""
        if not self.near_zero:
            return phi
        small = self._small(phi)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # nan: not in support
            own = phi + small @ self.follow.T
            if self.beside is not None:
                own[..., self.near_zero] = np.log1p(small / self.floor)
        return own

    def log_jacobian(self, phi: Floats, own: Floats | None = None) -> Floats:
        """log |d theta / d phi| up to a constant, shape (B,)."""
        own = self.own(phi) if own is None else own
        total = np.sum(np.where(self.log, own, 0.0), axis=-1)
        if self.beside is None:
            return total
        other = own[..., self.beside] * self.scale[self.beside] + self.beside_floor
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # nan: not in support
            given = (self.floor * np.exp(own[..., self.near_zero])) @ self._given_up
            return np.asarray(total - np.log1p(given / other))

    def inside(self, phi: Floats, own: Floats | None = None) -> NDArray[np.bool_]:
        """Which vectors lie in the support of the priors, shape (B,)."""
        own = self.own(phi) if own is None else own
        return np.all((own >= self.low) & (own <= self.high), axis=-1)


def coordinates(model: Model, linear: Collection[str] = ()) -> Coordinates:
    """The coordinates of `model`, whose priors must be set; those named in `linear` as they are."""
    priors = [model.prior(name) for name in model.names]
    asked = np.isin(model.names, list(linear))
    log = np.array([prior.coordinate == "log" for prior in priors]) & ~asked
    spread = np.array([float(p.quantile(0.84) - p.quantile(0.16)) for p in priors])
    scale = np.where(log, 1.0, spread)
    support = np.array([prior.support for prior in priors])
    with np.errstate(divide="ignore"):
        logs = np.where(log[:, None], np.log(np.where(log[:, None], support, 1.0)), 0.0)
    low, high = np.where(log[:, None], logs, support / scale[:, None]).T
    at_low = np.array([float(p.log_density(p.support[0])) for p in priors])
    return Coordinates(log, scale, low, high, ~log & np.isfinite(low) & np.isfinite(at_low))


def sampling_coordinates(model: Model, theta: Floats, sd: Floats) -> Coordinates:
    """The coordinates to sample `model` in, after a fit with `theta` and `sd` of shape (P,)."""
    sums: tuple[str, ...] = _SUMS
    # The springs of a chain are in series; only one that an effect adds may stand beside another.
    if any(p.dimension == "stiffness" for effect in model.effects for p in effect.parameters):
        sums = (*_SUMS, "stiffness")
    known = set()
    for name, value, error in zip(model.names, theta, sd, strict=True):
        prior, dimension = model.prior(name), model.parameter(name).dimension
        if prior.coordinate != "log" or dimension not in sums:
            continue
        believed = 0.5 * float(np.log(prior.quantile(0.84) / prior.quantile(0.16)))
        # A fit at a bound, where the error is nan, says nothing of where the peak is; but where
        # it leaves one of two springs side by side nothing, or a damper whose size nobody knows,
        # the ridge between them and others is straight.
        none = dimension == "damping" and is_wide(prior) and value < prior.quantile(0.5)
        left_out = not error > 0 and (dimension == "stiffness" or none)
        if left_out or (error > 0 and np.hypot(1 / believed, value / error) > 1 / _KNOWN):
            known.add(name)
    return coordinates(model, known)


def is_wide(prior: Prior) -> bool:
    """Whether a prior leaves open how large a parameter is."""
    return isinstance(prior, LogNormal) and prior.log_sd > _WIDE


def reach(model: Model, prior_sds: float) -> tuple[Floats, Floats]:
    """Lowest and highest natural values that a fit without priors may visit, shape (P,) each.

    They are the priors' quantiles at `prior_sds` standard deviations of a normal variable.
    """
    from scipy.special import ndtr

    tail = float(ndtr(-prior_sds))
    priors = [model.prior(name) for name in model.names]
    low = np.array([p.support[0] if p.coordinate == "linear" else p.quantile(tail) for p in priors])
    low = np.where(np.isfinite(low), low, [float(p.quantile(tail)) for p in priors])
    return low, np.array([float(p.quantile(1 - tail)) for p in priors])


def believed(model: Model, here: Coordinates) -> Floats:
    """Standard deviations of the priors in the coordinates, shape (P,)."""
    ends = np.array([model.prior(name).quantile(np.array([0.16, 0.84])) for name in model.names])
    low, high = (here.coordinate(end) for end in ends.T)
    return np.asarray(0.5 * (high - low))
