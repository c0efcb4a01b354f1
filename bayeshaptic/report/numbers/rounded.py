"""A stiffness to act on: rounded down, in the same digits wherever it stands."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bayeshaptic.quantities import quantity
from bayeshaptic.report.numbers.estimates import decibel

_WIDTH = 3.29  # of a normal 90 % interval, in standard deviations


@dataclass(frozen=True)
class Rounded:
    """A stiffness rounded down.

    Attributes
    ----------
    value : float
    text : str
        With its unit: ``"11.3 N m/rad"``.
    """

    value: float
    text: str

    @property
    def with_level(self) -> str:
        """As in ``"11.3 N m/rad (21.1 dB)"``."""
        return f"{self.text} ({decibel(self.value):.1f} dB)"


def rounded_down(
    stiffness: float, unit: str, low: float, high: float, lever_m: float = 1.0
) -> Rounded:
    """Three digits of a stiffness, or four where the limit is known to the fourth.

    Parameters
    ----------
    stiffness : float
        Infinite ones, and those that are not positive, stay as they are.
    unit : str
        Of what is written.
    low, high : float
        5 and 95 per cent quantile of the limit, whose standard deviation decides the digits.
    lever_m : float
        Of a rotational stiffness that is wanted at the tip.
    """
    stiffness, low, high = (value / lever_m**2 for value in (stiffness, low, high))
    if not (math.isfinite(stiffness) and stiffness > 0):
        return Rounded(stiffness, quantity(stiffness, unit))
    sd = (high - low) / _WIDTH
    exponent = math.floor(math.log10(stiffness))
    known = math.floor(math.log10(sd)) if 0 < sd < math.inf else exponent - 2
    step = 10.0 ** max(min(exponent - 2, known), exponent - 3)
    cut = math.floor(stiffness / step * (1 + 1e-12)) * step
    return Rounded(cut, quantity(cut, unit, digits=exponent - round(math.log10(step)) + 1))
