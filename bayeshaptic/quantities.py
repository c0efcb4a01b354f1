"""Numbers with units as a person writes them: digits by uncertainty, SI prefixes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

_PREFIXES = {-9: "n", -6: "\N{MICRO SIGN}", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_GRAMS = {-9: "\N{MICRO SIGN}g", -6: "mg", -3: "g", 0: "kg"}
_PREFIXABLE = ("N", "A", "s", "m", "Hz")
NOTHING = "\N{EN DASH}"  # where there is no number to write
NINETY = 3.29  # standard deviations that a normal 90 % interval is wide
_LONGEST = 12  # characters of a number: nine digits, a point, a sign and a zero
_FAR_APART = 1e4  # ends of an interval under one prefix


@dataclass(frozen=True)
class Scale:
    """How the numbers of one row are written: ``value * factor`` followed by `unit`.

    Attributes
    ----------
    factor : float
        1e-3 where newtons are written as kilonewtons.
    unit : str
        The unit with its prefix, for example ``"kN/m"``; empty for a pure number.
    """

    factor: float
    unit: str

    def number(
        self, value: float | None, sd: float | None = None, digits: int = 3, least: int = 2
    ) -> str:
        """The number alone: two digits of `sd` where that is known, else `digits` digits.

        `least` digits of the number itself are written, however large its `sd` is.  With a power of
        ten only where it would be longer than nine digits.
        """
        if value is None or not math.isfinite(value):
            return NOTHING
        scaled = value * self.factor
        decimals = _decimals(scaled, None if sd is None else sd * self.factor, digits, least)
        text = f"{round(scaled, decimals) + 0.0:.{max(decimals, 0)}f}"
        return minus(text if len(text) <= _LONGEST else f"{scaled:.1e}")

    def with_error(self, value: float | None, sd: float | None) -> str:
        """A number and its error, rounded alike: ``"0.590 ± 0.020"``, ``"220 ± 320"``; or alone."""
        number = self.number(value, sd, least=0)
        if value is None or not sd or not math.isfinite(sd):
            return number
        places, error_sd = len(number.partition(".")[2]), sd * self.factor
        decimals = min(places, _decimals(value * self.factor, error_sd, 3, 0))
        error = f"{round(error_sd, decimals):.{places}f}"
        return f"{number} ± {error}" if float(error) else number

    def quantity(self, value: float | None, sd: float | None = None, digits: int = 3) -> str:
        """The number with its unit."""
        return f"{self.number(value, sd, digits)} {self.unit}".rstrip()


def pretty_unit(unit: str) -> str:
    """A unit for reading: ``"kg m^2"`` becomes ``"kg m²"`` and ``"Nm"`` ``"N m"``."""
    spaced = "N m" + unit[2:] if unit == "Nm" or unit.startswith(("Nm/", "Nm ")) else unit
    return spaced.replace("^2", "²").replace("^3", "³").replace("*", " ")


def scale(values: float | Iterable[float | None], unit: str) -> Scale:
    """The SI prefix under which the largest of `values` reads as a number from 0.1 to 1000.

    Masses go from kilograms to grams; units that take no prefix (dB, rad, none) stay as they are.
    """
    unit = pretty_unit(unit)
    given = [values] if isinstance(values, int | float) else list(values)
    sizes = [abs(v) for v in given if v is not None and math.isfinite(v) and v != 0.0]
    if not sizes:
        return Scale(1.0, unit)
    head, rest = _first_symbol(unit)
    # 999.7 is written 1.000 k; and 0.19 kg, 0.85 g m^2 read better than 190 g, 850 mg m^2.
    exponent = math.log10(max(sizes) * 1.0005)
    power = 3 * math.floor(exponent / 3)
    if power < 0 and exponent - power >= 2.0 and head != "s":
        power += 3
    if head == "kg":
        power = min(max(power, min(_GRAMS)), 0)
        return Scale(10.0**-power, _GRAMS[power] + rest)
    if head not in _PREFIXABLE:
        return Scale(1.0, unit)
    power = min(max(power, min(_PREFIXES)), 0 if head == "s" else max(_PREFIXES))
    return Scale(10.0**-power, _PREFIXES[power] + unit)


def quantity(value: float | None, unit: str, sd: float | None = None, digits: int = 3) -> str:
    """A number with its unit, for example ``"22.1 kN/m"``; a dash for a missing one."""
    if value is None or not math.isfinite(value):
        return NOTHING
    return scale(value, unit).quantity(value, sd, digits)


def interval(low: float | None, high: float | None, unit: str, sd: float | None = None) -> str:
    """Two ends of an interval with one unit, for example ``"21.9 to 22.4 kN/m"``.

    Ends that are decades apart have a prefix each.
    """
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return NOTHING
    if _far_apart(low, high):
        return f"{quantity(low, unit, digits=2)} to {quantity(high, unit, digits=2)}"
    row = scale((low, high), unit)
    spread = spread_of(low, high) if sd is None else sd
    return f"{row.number(low, spread)} to {row.number(high, spread)} {row.unit}".rstrip()


def spread_of(low: float, high: float) -> float:
    """What decides the digits of a 90 % interval: two digits of its width, five digits in all.

    Its ends are quantiles of draws, known to some hundredths of the width.
    """
    return max(high - low, 1e-3 * max(abs(low), abs(high)))


def estimate(middle: float, low: float, high: float, unit: str) -> str:
    """A value and its interval with the same digits: ``"22.3 (21.9 to 22.7) kN/m"``."""
    if _far_apart(low, high):
        return f"{quantity(middle, unit, digits=2)} ({interval(low, high, unit)})"
    row = scale((low, middle, high), unit)
    spread = spread_of(low, high)
    numbers = [row.number(value, spread) for value in (middle, low, high)]
    return f"{numbers[0]} ({numbers[1]} to {numbers[2]}) {row.unit}".rstrip()


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


def decibel(stiffness: float) -> float:
    """20 log10 of a stiffness in SI units; minus infinity for zero."""
    return 20 * math.log10(stiffness) if stiffness > 0 else -math.inf


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
        return Rounded(stiffness, "any" if stiffness == math.inf else quantity(stiffness, unit))
    sd = (high - low) / NINETY
    exponent = math.floor(math.log10(stiffness))
    known = math.floor(math.log10(sd)) if 0 < sd < math.inf else exponent - 2
    step = 10.0 ** max(min(exponent - 2, known), exponent - 3)
    cut = math.floor(stiffness / step * (1 + 1e-12)) * step
    return Rounded(cut, quantity(cut, unit, digits=exponent - round(math.log10(step)) + 1))


def pure(value: float, digits: int = 3) -> str:
    """A number without a unit and without powers of ten: ``"10,400"``, ``"0.957"``."""
    if not math.isfinite(value):
        return NOTHING
    return minus(f"{float(f'{value:.{digits}g}'):,.10g}")


def percent(probability: float) -> str:
    """A probability in per cent, for example ``"1 %"``, ``"0.1 %"``; never 0 or 100 by rounding."""
    if 0.0 < probability < 0.00095:
        return "under 0.1 %"
    if 0.995 < probability < 1.0:
        return "over 99 %"
    digits = 2 if probability < 0.1 else 0
    text = f"{100 * probability:.{digits}g}" if digits else f"{100 * probability:.0f}"
    return f"{text} %"


def percents(probabilities: Sequence[float]) -> str:
    """Probabilities that share one row: ``"5 % to 0.1 %"``."""
    ends = (percent(probabilities[0]), percent(probabilities[-1]))
    return " to ".join(dict.fromkeys(ends))


def _far_apart(low: float, high: float) -> bool:
    """Whether one prefix would write one of two ends with a row of zeros."""
    return math.inf > high > _FAR_APART * low > 0


def _first_symbol(unit: str) -> tuple[str, str]:
    for position, character in enumerate(unit):
        if character in " /²³":
            return unit[:position], unit[position:]
    return unit, ""


def _decimals(value: float, sd: float | None, digits: int, least: int) -> int:
    """Decimal places: two digits of `sd`, but at least `least` and at most nine of `value`."""
    if value == 0.0:
        if sd is None or not 0.0 < sd < math.inf:
            return 0
        return max(1 - math.floor(math.log10(sd)), 0)
    # Of the rounded number: 0.09998 is written 0.100.
    exponent = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if sd is None or not math.isfinite(sd) or sd <= 0.0:
        return digits - 1 - exponent
    wanted = 1 - math.floor(math.log10(sd))
    most_digits = 9
    return min(max(wanted, least - 1 - exponent) if least else wanted, most_digits - 1 - exponent)


def minus(text: str) -> str:
    """The text of a number with minus signs for its hyphens."""
    return text.replace("-", "\N{MINUS SIGN}")
