"""Prior densities of one parameter each, in its natural (physical) value.

Each prior also names the coordinate in which the parameter is sampled: ``"log"`` for quantities
that are positive and known up to a factor, ``"linear"`` for those that may be zero (dampers).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr, ndtri

from bayeshaptic.arguments import check_fields
from bayeshaptic.errors import InputError
from bayeshaptic.quantities import quantity, scale
from bayeshaptic.types import Floats

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
    """`size` independent draws from `prior`, by inversion."""
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


class _ByTerms(Prior):
    """A prior whose density is of the form of `Terms`."""

    @property
    def terms(self) -> Terms:
        """What the density is made of."""
        raise NotImplementedError

    def log_density(self, x: ArrayLike) -> Floats:
        return self.terms(x)


@dataclass(frozen=True)
class LogNormal(_ByTerms):
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
    def terms(self) -> Terms:
        constant = -np.log(self.log_sd) - _LOG_SQRT_2PI
        smallest = float(np.nextafter(0.0, 1.0))
        centre = float(np.log(self.median))
        return Terms(smallest, np.inf, constant, centre, self.log_sd, True, 1.0)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.median * np.exp(self.log_sd * ndtri(np.asarray(p, float)))

    def describe(self, unit: str) -> str:
        factor = np.exp(self.log_sd)
        return f"log-normal, median {quantity(self.median, unit)}, factor {factor:.3g} a sd"


@dataclass(frozen=True)
class HalfNormal(_ByTerms):
    """abs(z), z normal around zero with standard deviation `scale`: for dampers, which may be 0."""

    scale: float
    coordinate = "linear"
    support = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.scale > 0:
            raise InputError(f"HalfNormal needs scale > 0, got {self}.")

    @property
    def terms(self) -> Terms:
        constant = np.log(2 / self.scale) - _LOG_SQRT_2PI
        return Terms(0.0, np.inf, constant, sd=self.scale)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.scale * ndtri(0.5 + 0.5 * np.asarray(p, float))

    def describe(self, unit: str) -> str:
        return f"half-normal from zero, scale {quantity(self.scale, unit)}"


@dataclass(frozen=True)
class NearZero(_ByTerms):
    """Density proportional to exp(-x^2 / (2 scale^2)) / (x + floor)^(1 - rise): dampers, maybe 0.

    A published zero says that nothing was seen, not how little there is.  Between `floor` and
    `scale` every factor is alike, so that on whatever scale the data tell zero from something,
    much of the probability lies next to zero; a half-normal is flat there and pushes away from it.
    With a `rise`, below one, every factor e has exp(rise) times the probability of the one below
    it: where nobody said zero, next to it lies 1 / rise times what is in a factor e above it, on
    whatever scale.
    """

    scale: float
    floor: float
    rise: float = 0.0
    coordinate = "linear"
    support = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not 1e-12 * self.scale <= self.floor < self.scale:
            raise InputError(
                f"NearZero needs a floor below its scale, by a factor of 1e12 at most; got {self}."
            )
        if not 0 <= self.rise < 1:
            raise InputError(f"NearZero needs a rise of at least 0 and below 1; got {self}.")

    @property
    def terms(self) -> Terms:
        whole = _near_zero(self.floor / self.scale, self.rise)[0]
        constant = -np.log(whole) - self.rise * np.log(self.floor)
        over = 1 - self.rise
        return Terms(0.0, np.inf, constant, sd=self.scale, over_x=over, shift=self.floor)

    def quantile(self, p: ArrayLike) -> Floats:
        _, factors, below = _near_zero(self.floor / self.scale, self.rise)
        return self.floor * np.expm1(np.interp(np.asarray(p, float), below, factors))

    def describe(self, unit: str) -> str:
        of = f"x^{self.rise - 1:.3g}" if self.rise else "log-uniform"
        return (
            f"near zero: {of} from {quantity(self.floor, unit)} to {quantity(self.scale, unit)} "
            "with soft ends, zero included"
        )


@lru_cache(maxsize=64)
def _near_zero(ratio: float, rise: float) -> tuple[float, Floats, Floats]:
    """The integral of a `NearZero` density; log(1 + x / floor) with the probability below it."""
    from scipy.integrate import cumulative_simpson

    factors = np.linspace(0.0, np.log1p(9.0 / ratio), 20_001)
    density = np.exp(rise * factors - 0.5 * (ratio * np.expm1(factors)) ** 2)
    below = np.maximum.accumulate(cumulative_simpson(density, x=factors, initial=0.0))
    return float(below[-1]), factors, below / below[-1]


@dataclass(frozen=True)
class Normal(_ByTerms):
    """Normal around `mean` with standard deviation `sd`, cut off below `low` (by default not)."""

    mean: float
    sd: float
    low: float = -np.inf
    coordinate = "linear"

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.sd > 0:
            raise InputError(f"Normal needs sd > 0, got {self}.")

    @property
    def support(self) -> tuple[float, float]:
        return (self.low, np.inf)

    @property
    def _mass_below(self) -> float:
        return float(ndtr((self.low - self.mean) / self.sd))

    @property
    def terms(self) -> Terms:
        constant = -np.log(self.sd) - _LOG_SQRT_2PI - np.log1p(-self._mass_below)
        return Terms(self.low, np.inf, constant, self.mean, self.sd)

    def quantile(self, p: ArrayLike) -> Floats:
        below = self._mass_below
        return self.mean + self.sd * ndtri(below + np.asarray(p, float) * (1 - below))

    def describe(self, unit: str) -> str:
        row = scale((self.mean, self.sd), unit)
        cut = f", not below {quantity(self.low, unit)}" if np.isfinite(self.low) else ""
        return f"normal, {row.with_error(self.mean, self.sd)} {row.unit}".rstrip() + cut


@dataclass(frozen=True)
class Uniform(_ByTerms):
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
    def terms(self) -> Terms:
        return Terms(self.low, self.high, -np.log(self.high - self.low))

    def quantile(self, p: ArrayLike) -> Floats:
        return self.low + (self.high - self.low) * np.asarray(p, float)

    def describe(self, unit: str) -> str:
        return f"uniform from {quantity(self.low, unit)} to {quantity(self.high, unit)}"


@dataclass(frozen=True)
class LogUniform(_ByTerms):
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
    def terms(self) -> Terms:
        constant = -np.log(np.log(self.high / self.low))
        return Terms(self.low, self.high, constant, over_x=1.0)

    def quantile(self, p: ArrayLike) -> Floats:
        return self.low * (self.high / self.low) ** np.asarray(p, float)

    def describe(self, unit: str) -> str:
        return f"log-uniform from {self.low:.4g} to {self.high:.4g} {unit}"
