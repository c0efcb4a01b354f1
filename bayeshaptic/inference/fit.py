"""A weighted least-squares fit: what it is, and what is known at its optimum."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.inference.coordinates import Coordinates, coordinates, reach
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.numerics.gauss_newton import jacobian, root_of_covariance
from bayeshaptic.quantities import quantity, scale
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.shown import Shown, data_frame, listed
from bayeshaptic.types import Complexes, Floats

_CLEAR_SDS = 2.0  # beyond which a number is clearly above zero; counts in docs/statistics.md
CONVERGED, AT_BOUND, PRIOR_DOMINATED = "converged", "at a bound", "prior-dominated"
MISFIT = 1.3  # reduced chi-square of a model that lacks something; clean recordings stay below 1.1
SAME_PERIOD = 1e-3  # relative: time stamps are rounded
REACH_SDS = 6.0  # a fit without priors may go so many prior standard deviations out


@dataclass(frozen=True, eq=False, repr=False)
class Fit(Shown):
    """A weighted least-squares fit.

    Attributes
    ----------
    model : Model
        With the priors, period and units that the fit used.
    theta : ndarray, shape (P,)
        Best parameters, natural values.
    covariance : ndarray, shape (P, P)
        In natural values, scaled by the reduced chi-square where that exceeds 1; nan in the rows
        of parameters at a bound.
    outcome : mapping
        Name to "converged", "at a bound", or "prior-dominated" (the data alone say less than the
        prior: the sd exceeds the prior's).
    reduced_chi_square : float
        1 where the residual is noise.
    log_likelihood : float
    windows : Windows
        Compressed around this very fit.
    frequency_hz : ndarray, shape (L,)
    residual : complex ndarray, shape (L,)
        Normalised deviations: E|.|^2 = 1 where the model is true.
    starts : int
        How many starting points ended within 0.5 of the best half chi-square, of those refined.
    elsewhere : ndarray, shape (V, P)
        Where many starting points ended that did not end here: a model that lacks something may fit
        best when bent far from the truth.
    alike : ndarray, shape (A, P)
        Where starting points ended that fit about as well: a device may have more than one.
    etfe : Etfe or None
        What was fitted, where it was a response as it stands.
    """

    model: Model
    theta: Floats
    covariance: Floats
    outcome: Mapping[str, str]
    reduced_chi_square: float
    log_likelihood: float
    windows: Windows = field(repr=False)
    frequency_hz: Floats = field(repr=False)
    residual: NDArray[np.complex128] = field(repr=False)
    starts: int = 0
    elsewhere: Floats = field(default_factory=lambda: np.empty((0, 0)), repr=False, kw_only=True)
    alike: Floats = field(default_factory=lambda: np.empty((0, 0)), repr=False, kw_only=True)
    etfe: Etfe | None = field(default=None, repr=False, kw_only=True)

    @property
    def by_chance(self) -> float:
        """Reduced chi-square that noise alone hardly reaches.

        It scatters by one over the root of the number of points.
        """
        return 1.0 + 4.0 / math.sqrt(max(len(self.residual), 1))  # four standard deviations

    @property
    def misfits(self) -> bool:
        """Whether the model lacks something: a residual far beyond the noise, and not by chance."""
        return not self.reduced_chi_square <= max(MISFIT, self.by_chance)

    @property
    def impossible(self) -> tuple[str, ...]:
        """Masses, and the loop's delay, that end at a bound, where no device is.

        A delay of zero means that the position was written down before its command acted (a loop
        that has no delay is told so, and then the delay is no parameter); a damper may well be
        zero.  Of 194 fits to open loops 12 end so, all of a position a sample early, with limits
        1.7 to 179 times the truth (docs/door.md).
        """
        ends = [name for name, how in self.outcome.items() if how == AT_BOUND]
        return impossible_at_bounds(self.model, ends)

    @property
    def run_away(self) -> bool:
        """Whether a mass has run away to a bound (see `runs_away`), or could as well."""
        return runs_away(self.impossible or self.as_ground)

    @property
    def as_ground(self) -> tuple[str, ...]:
        """The heaviest mass where it may as well be the ground: one over it may well be zero."""
        masses = [n for n in self.model.names if self.model.parameter(n).dimension == "mass"]
        at = max(map(self.model.names.index, masses), key=lambda i: self.theta[i])
        clear = self.theta[at] > _CLEAR_SDS * self.sd[at]  # as of one over it; nan at a bound
        hand_or_one = self.model.held or len(masses) < 2  # a hand is more than its mass
        return () if hand_or_one or clear else (self.model.names[at],)

    @property
    def sd(self) -> Floats:
        """Standard deviations, shape (P,); nan for parameters at a bound."""
        return np.sqrt(np.diag(self.covariance))

    @cached_property
    def likelihood(self) -> Likelihood:
        return Likelihood(self.model, self.windows)

    def at(self, theta: Floats) -> Fit:
        """The fit of the same data at other values.

        Parameters
        ----------
        theta : ndarray, shape (P,)
        """
        there = summarise(self.model, self.windows, theta, self.starts)
        return replace(there, alike=self.alike, etfe=self.etfe)

    def response(self, frequency_hz: Floats) -> NDArray[np.complex128]:
        """The fitted sampled response at `frequency_hz`, of any shape, as it is measured."""
        found = self.model.response(self.theta, frequency_hz.ravel(), measured=True)
        return found.reshape(frequency_hz.shape)

    def sensor(self, frequency_hz: Floats) -> NDArray[np.complex128]:
        """That over the loop's own, shape (L,): one unless a force's sensor lags.

        Parameters
        ----------
        frequency_hz : ndarray, shape (L,)
        """
        if "force_lag_s" not in self.model.names:
            return np.ones(len(frequency_hz), complex)
        return self.response(frequency_hz) / self.model.response(self.theta, frequency_hz)

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a parameter: value, sd, unit, outcome."""
        return data_frame(
            (
                {
                    "parameter": name,
                    "value": float(self.theta[i]),
                    "sd": float(self.sd[i]),
                    "unit": self.model.unit(name),
                    "outcome": self.outcome[name],
                }
                for i, name in enumerate(self.model.names)
            ),
            "parameter",
        )

    def to_control(self) -> Any:
        """The sampled response of the fit for python-control: see `Model.to_control`."""
        return self.model.to_control(self.theta)

    def _lines(self) -> tuple[str, ...]:
        found = []
        for name, value, sd in zip(self.model.names, self.theta, self.sd, strict=True):
            row = scale(float(value), self.model.unit(name))
            found.append(f"{name} {row.with_error(float(value), float(sd))} {row.unit}".rstrip())
        return (
            f"Least-squares fit of the model {self.model.name}",
            f"reduced chi-square {quantity(self.reduced_chi_square, '')}, where 1 is pure noise",
            listed(found, 4),
        )


def refuse_unfit(model: Model, etfe: Etfe, start: Floats | None) -> None:
    """Refuse to fit a model of another period, or to begin where it has no such parameters.

    Parameters
    ----------
    model : Model
    etfe : Etfe
    start : ndarray or None

    Raises
    ------
    InputError
        With what to give. The data come before a device's file, here as everywhere.
    """
    shape = () if start is None else np.shape(start)
    if start is not None and (len(shape) not in (1, 2) or shape[-1] != model.size):
        raise InputError(
            f"start has the shape {shape}; give the {model.size} parameters of the {model.name} "
            f"model ({', '.join(model.names)}), or rows of them"
        )
    device = model.device
    if model.period_s is None or (device is not None and device.period_s == model.period_s):
        return
    if abs(model.period_s / etfe.period_s - 1) > SAME_PERIOD:
        raise InputError(
            f"the model's period_s is {model.period_s:g} s, and the response was measured every "
            f"{etfe.period_s:g} s; leave period_s out, or give that of the response"
        )


def impossible_at_bounds(model: Model, ends: Iterable[str]) -> tuple[str, ...]:
    """Which of the parameters that end at a bound no device has there: see `Fit.impossible`."""
    return tuple(n for n in ends if n == "delay_s" or model.parameter(n).dimension == "mass")


def runs_away(impossible: Collection[str]) -> bool:
    """Whether a mass has become the ground, or nothing, of a device that another fit may be like.

    Not where the delay ends at zero as well: force and position are not of one sample then, which
    no other fit mends, and one without a bound would hide it.
    """
    return bool(impossible) and "delay_s" not in impossible


def ends_at_bounds(phi: Floats, low: Floats, high: Floats) -> NDArray[np.bool_]:
    """Which coordinates of a fit, shape (P,), lie at a bound of its search."""
    width = high - low
    return (phi - low < 1e-6 * width) | (high - phi < 1e-6 * width)


def search_box(model: Model) -> tuple[Coordinates, Floats, Floats]:
    """The coordinates of a fit, and its lower and upper bounds in them, shape (P,) each."""
    here = coordinates(model)
    low, high = (here.coordinate(bound) for bound in reach(model, REACH_SDS))
    return here, low, high


def weighted_residuals(likelihood: Likelihood, here: Coordinates) -> Callable[[Floats], Floats]:
    """Real residuals of unit variance, as a function of coordinates: (B, P) to (B, N)."""

    def residuals(phi: Floats) -> Floats:
        parts = likelihood.normalised(here.natural(phi)).view(float).reshape(len(phi), -1)
        parts *= np.sqrt(2)  # as `real_parts`, in place: these are megabytes
        return parts

    return residuals


def real_parts(normalised: Complexes) -> Floats:
    """Real residuals of unit variance, (B, N), of normalised deviations.

    A window after the other, of each number the real part and then the imaginary one.
    """
    return np.sqrt(2) * normalised.view(float).reshape(len(normalised), -1)


def summarise(model: Model, windows: Windows, theta: Floats, agreeing: int = 0) -> Fit:
    """The fit at `theta`, shape (P,), with its covariance and outcomes."""
    here, low, high = search_box(model)
    likelihood = Likelihood(model, windows)
    phi = here.coordinate(theta[None])
    slope = jacobian(weighted_residuals(likelihood, here), phi)[0]
    bound = ends_at_bounds(phi[0], low, high)
    chi_square = float(likelihood.reduced_chi_square(theta[None])[0])
    covariance = np.full((model.size, model.size), np.nan)
    inner = np.flatnonzero(~bound)
    # A direction that the data do not see at all gets a width of 50 coordinate units, not zero.
    stretch = np.where(here.log, theta, here.scale)[inner]
    root = stretch[:, None] * root_of_covariance(slope[:, inner], widest=50.0)
    covariance[np.ix_(inner, inner)] = (root @ root.T) * max(1.0, chi_square)
    sd = np.sqrt(np.diag(covariance))
    return Fit(
        model,
        theta,
        covariance,
        _outcomes(model, theta, sd, bound),
        chi_square,
        float(likelihood(theta[None])[0]),
        windows,
        windows.places_hz.ravel(),
        likelihood.normalised(theta[None])[0].ravel(),
        agreeing,
    )


def _outcomes(model: Model, theta: Floats, sd: Floats, bound: NDArray[np.bool_]) -> dict[str, str]:
    outcome = {}
    for i, name in enumerate(model.names):
        prior = model.prior(name)
        spread = 0.5 * float(prior.quantile(0.84) - prior.quantile(0.16))
        known = PRIOR_DOMINATED if sd[i] > spread else CONVERGED
        outcome[name] = AT_BOUND if bound[i] else known
    return outcome
