"""Prior densities of what may be zero, or next to it: dampers that nobody saw."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from bayeshaptic.arguments import check_fields
from bayeshaptic.errors import InputError
from bayeshaptic.models.prior import ByTerms, HalfNormal, Prior, Terms
from bayeshaptic.quantities import quantity
from bayeshaptic.types import Floats

# Standard deviations of what is seen that weigh as much as zero does.  Of estimates with unit
# variance around dampers of 0 to 5, and a limit that goes with them (correlation 0.6 to 1), the
# mean pull of the limit is then between -0.45 and +0.58 of its standard deviations and its 90 %
# interval holds it in 86 % at least; with two and with five standard deviations, and with a density
# rising as x^(1/4) over the logarithm: 0.67, 0.72, 0.77, and 88, 83, 79 %.
SPIKE = 3.0
# The same for a damper that a motor has, which turns in bearings: it may be small, but hardly zero.
# Taken for zero it puts the limit of a free device too high (correlation -0.97): of dampers of one
# and two standard deviations the truth lies below its 5 % point in 8 % with 3, in 3 and 5 % with
# this, and the mean pull is +0.40, +0.26 and +0.05, +0.13.
SPIKE_OF_MOTOR = 1.5


@dataclass(frozen=True)
class NearZero(ByTerms):
    """Density proportional to exp(-x^2 / (2 scale^2)) / (x + floor)^(1 - rise): dampers, maybe 0.

    A published zero says that nothing was seen, not how little there is.  Between `floor` and
    `scale` every factor is alike, so that on whatever scale the data tell zero from something,
    much of the probability lies next to zero; a half-normal is flat there and pushes away from it.
    With a `rise`, below one, every factor e has exp(rise) times the probability of the one below
    it: next to zero lies 1 / rise times what is in a factor e above it, on whatever scale.
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
    def parts(self) -> tuple[Terms, ...]:
        whole = _near_zero(self.floor / self.scale, self.rise)[0]
        constant = -np.log(whole) - self.rise * np.log(self.floor)
        over = 1 - self.rise
        return (Terms(0.0, np.inf, constant, sd=self.scale, over_x=over, shift=self.floor),)

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


def weight_of_zero(prior: Prior) -> float:
    """Standard deviations that weigh as much as zero: of a published zero, or of nobody who knows.

    Nothing for a prior that does not believe in zero itself.
    """
    if isinstance(prior, MaybeZero):
        return prior.weight
    return SPIKE if isinstance(prior, NearZero) and not prior.rise else 0.0


@dataclass(frozen=True)
class MaybeZero(ByTerms):
    """Half-normal of `scale`, or zero: a slab and a spike, for dampers that may not be there.

    At zero lies as much probability as in `weight` of the standard deviations `seen` with which a
    recording knows the damper.  The spike is log-uniform below a thirtieth of that, so that no
    recording tells it from zero, and down to a hundredth of its own width, so that walkers find it
    (continuous spikes: E. I. George and R. E. McCulloch, Journal of the American Statistical
    Association 88, 1993).  Where `seen` is not given, sampling takes it from its fit; until then
    the prior is the half-normal.
    """

    scale: float
    seen: float | None = None
    weight: float = SPIKE
    coordinate = "linear"
    support = (0.0, np.inf)

    def __post_init__(self) -> None:
        check_fields(self, globals())
        if not self.scale > 0 or (self.seen is not None and not self.seen > 0):
            raise InputError(f"MaybeZero needs scale > 0 and seen > 0, got {self}.")
        if not 0 < self.weight < np.inf:
            raise InputError(f"MaybeZero needs a weight above 0, got {self}.")

    @cached_property
    def spike(self) -> NearZero:
        """What stands for zero."""
        width = (self.scale if self.seen is None else self.seen) / 30
        return NearZero(width, width / 100)

    @property
    def floor(self) -> float:
        """Below that every value is alike."""
        return self.spike.floor

    @property
    def zero(self) -> float:
        """The probability of the spike."""
        if self.seen is None:
            return 0.0
        odds = self.weight * self.seen * float(np.sqrt(2 / np.pi)) / self.scale
        return odds / (1 + odds)

    @cached_property
    def parts(self) -> tuple[Terms, ...]:
        """Slab and spike, with their shares."""
        (slab,), (spike,) = HalfNormal(self.scale).parts, self.spike.parts
        with np.errstate(divide="ignore"):
            return (
                replace(slab, constant=slab.constant + float(np.log1p(-self.zero))),
                replace(spike, constant=spike.constant + float(np.log(self.zero))),
            )

    def quantile(self, p: ArrayLike) -> Floats:
        return np.interp(np.asarray(p, float), *_maybe_zero(self))

    def describe(self, unit: str) -> str:
        slab = HalfNormal(self.scale).describe(unit)
        if self.seen is None:
            return slab
        return f"{slab}; zero weighs as much as {quantity(self.weight * self.seen, unit)}"


@lru_cache(maxsize=64)
def _maybe_zero(prior: MaybeZero) -> tuple[Floats, Floats]:
    """Probabilities, and the values that a prior is below with them."""
    _, factors, spike = _near_zero(prior.floor / prior.spike.scale, prior.spike.rise)
    log = np.linspace(np.log(1e-3 * prior.floor), np.log(9 * prior.scale), 20_000)
    x = np.append(0.0, np.exp(log))
    below = prior.zero * np.interp(np.log1p(x / prior.floor), factors, spike)
    below += (1 - prior.zero) * (2 * ndtr(x / prior.scale) - 1)
    rising = np.append(True, np.diff(below) > 0)
    return below[rising], x[rising]
