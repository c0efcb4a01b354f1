"""Prior densities of one parameter each, in its natural (physical) value.

Each prior also names the coordinate in which the parameter is sampled: ``"log"`` for quantities
that are positive and known up to a factor, ``"linear"`` for those that may be zero (dampers).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from bayeshaptic.arguments import check_fields
from bayeshaptic.errors import InputError
from bayeshaptic.quantities import quantity, scale
from bayeshaptic.types import Floats

_MOST_CUT = 6.0  # standard deviations above the mean: a part in 1e9 is left, and its digits end
_LOG_SQRT_2PI = 0.5 * np.log(2 * np.pi)


@runtime_checkable
class Prior(Protocol):
    """What every prior offers: density, quantiles, support, and the coordinate to sample in."""

    @property
    def coordinate(self) -> str:
        """ "log" or "linear": in what the parameter is sampled."""

    @property
    def support(self) -> tuple[float, float]:
        """Lowest and highest possible value."""

    def log_density(self, x: ArrayLike) -> Floats:
        """Log of the density at natural values `x`, of any shape; -inf outside the support."""

    def quantile(self, p: ArrayLike) -> Floats:
        """The values that the parameter is below with probabilities `p`, of any shape."""

    def describe(self, unit: str) -> str:
        """The prior in words, with numbers in the parameter's `unit`."""


def draw(prior: Prior, rng: np.random.Generator, size: int) -> Floats:
    """Independent draws from `prior`, shape (size,), by inversion."""
    return prior.quantile(rng.uniform(size=size))


@dataclass(frozen=True)
class Terms:
    """What a log density is made of, for `joint_prior.py`: between `low` and `high`

        constant - ((t - centre) / sd)^2 / 2 - over_x log(x + shift),

    t = log(x + shift) where it is `logarithmic`, and x where not.
    """

    low: float
    high: float
    constant: float
    centre: float = 0.0
    sd: float = np.inf
    logarithmic: bool = False
    over_x: float = 0.0
    shift: float = 0.0

    def __call__(self, x: ArrayLike) -> Floats:
        """The log density at `x`, of any shape."""
        x = np.asarray(x, float)
        with np.errstate(divide="ignore", invalid="ignore"):
            log = np.log(x + self.shift)
            u = ((log if self.logarithmic else x) - self.centre) / self.sd
            density = self.constant - 0.5 * u * u - (self.over_x * log if self.over_x else 0.0)
        return np.where((x >= self.low) & (x <= self.high), density, -np.inf)


class ByTerms(Prior):
    """A prior whose density is a sum of densities of the form of `Terms`: of one, mostly."""

    @property
    def parts(self) -> tuple[Terms, ...]:
        """What the density is the sum of."""
        raise NotImplementedError

    def log_density(self, x: ArrayLike) -> Floats:
        first, *others = (part(x) for part in self.parts)
        for other in others:
            first = np.logaddexp(first, other)
        return first


@dataclass(frozen=True)
class LogNormal(ByTerms):
    """log(x) is normal around log(median) with standard deviation `log_sd`."""

    median: float
    log_sd: float
    coordinate = "log"
    support = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not (self.median > 0 and self.log_sd > 0):
            raise InputError(f"LogNormal needs median > 0 and log_sd > 0, got {self}.")

    @property
    def parts(self) -> tuple[Terms, ...]:
        constant = -np.log(self.log_sd) - _LOG_SQRT_2PI
        smallest = float(np.nextafter(0.0, 1.0))
        centre = float(np.log(self.median))
        return (Terms(smallest, np.inf, constant, centre, self.log_sd, True, 1.0),)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.median * np.exp(self.log_sd * ndtri(np.asarray(p, float)))

    def describe(self, unit: str) -> str:
        factor = np.exp(self.log_sd)
        return f"log-normal, median {quantity(self.median, unit)}, factor {factor:.3g} a sd"


@dataclass(frozen=True)
class HalfNormal(ByTerms):
    """abs(z), z normal around zero with standard deviation `scale`: for dampers, which may be 0."""

    scale: float
    coordinate = "linear"
    support = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.scale > 0:
            raise InputError(f"HalfNormal needs scale > 0, got {self}.")

    @property
    def parts(self) -> tuple[Terms, ...]:
        constant = np.log(2 / self.scale) - _LOG_SQRT_2PI
        return (Terms(0.0, np.inf, constant, sd=self.scale),)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.scale * ndtri(0.5 + 0.5 * np.asarray(p, float))

    def describe(self, unit: str) -> str:
        return f"half-normal from zero, scale {quantity(self.scale, unit)}"


@dataclass(frozen=True)
class Normal(ByTerms):
    """Normal around `mean` with standard deviation `sd`, cut off below `low` (by default not)."""

    mean: float
    sd: float
    low: float = -np.inf
    coordinate = "linear"

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.sd > 0:
            raise InputError(f"Normal needs sd > 0, got {self}.")
        if self.low > self.mean + _MOST_CUT * self.sd:
            raise InputError(
                f"Normal needs low below mean + {_MOST_CUT:g} sd: nothing is above; got {self}."
            )

    @property
    def support(self) -> tuple[float, float]:
        return (self.low, np.inf)

    @property
    def _mass_below(self) -> float:
        return float(ndtr((self.low - self.mean) / self.sd))

    @property
    def parts(self) -> tuple[Terms, ...]:
        constant = -np.log(self.sd) - _LOG_SQRT_2PI - np.log1p(-self._mass_below)
        return (Terms(self.low, np.inf, constant, self.mean, self.sd),)

    def quantile(self, p: ArrayLike) -> Floats:
        below = self._mass_below
        return self.mean + self.sd * ndtri(below + np.asarray(p, float) * (1 - below))

    def describe(self, unit: str) -> str:
        row = scale((self.mean, self.sd), unit)
        cut = f", not below {quantity(self.low, unit)}" if np.isfinite(self.low) else ""
        return f"normal, {row.with_error(self.mean, self.sd)} {row.unit}".rstrip() + cut


@dataclass(frozen=True)
class Uniform(ByTerms):
    """Every value between `low` and `high` alike."""

    low: float
    high: float
    coordinate = "linear"

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.high > self.low:
            raise InputError(f"Uniform needs low < high, got {self}.")

    @property
    def support(self) -> tuple[float, float]:
        return (self.low, self.high)

    @property
    def parts(self) -> tuple[Terms, ...]:
        return (Terms(self.low, self.high, -np.log(self.high - self.low)),)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.low + (self.high - self.low) * np.asarray(p, float)

    def describe(self, unit: str) -> str:
        return f"uniform from {quantity(self.low, unit)} to {quantity(self.high, unit)}"


@dataclass(frozen=True)
class LogUniform(ByTerms):
    """Every factor between `low` and `high` alike."""

    low: float
    high: float
    coordinate = "log"

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not 0 < self.low < self.high:
            raise InputError(f"LogUniform needs 0 < low < high, got {self}.")

    @property
    def support(self) -> tuple[float, float]:
        return (self.low, self.high)

    @property
    def parts(self) -> tuple[Terms, ...]:
        constant = -np.log(np.log(self.high / self.low))
        return (Terms(self.low, self.high, constant, over_x=1.0),)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.low * (self.high / self.low) ** np.asarray(p, float)

    def describe(self, unit: str) -> str:
        return f"log-uniform from {self.low:.4g} to {self.high:.4g} {unit}"
