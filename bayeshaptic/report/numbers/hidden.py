"""Numbers of what could hide, as a person writes them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.quantities import estimate, minus, percent, quantity

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.hidden.hidden import HiddenEffect
    from bayeshaptic.stability.critical import CriticalStiffness

FEW = 0.005  # dB below which nothing moves the limit


def in_short(analysis: Analysis) -> str:
    """A fact of the first screen; empty where nothing was asked."""
    hidden = analysis.hidden
    if hidden is None:
        return ""
    first = next(iter(hidden.effects), None)
    declared = interval_of(hidden.declared)
    text = "allowed for; it leaves the interval as it is"
    if declared != interval_of(analysis.limit):
        text = f"allowed for; if the model were exact, the limit would be {declared}"
    if first is None or reach(first) < FEW:
        return text
    return (
        f"{text}. What counts most: {first.title}, {percent(first.probability)} likely "
        f"({first.what} {size(first)}: {moves(first)})"
    )


def likely(analysis: Analysis) -> HiddenEffect | None:
    """What is there more likely than not, though no test sees it: the likeliest of those."""
    found = () if analysis.hidden is None else analysis.hidden.effects
    even = 0.5
    likeliest = max(found, key=lambda effect: effect.probability, default=None)
    return likeliest if likeliest is not None and likeliest.probability > even else None


def interval_of(limit: CriticalStiffness) -> str:
    """Median and 90 % interval."""
    low, middle, high = limit.quantile([0.05, 0.5, 0.95])
    if not all(math.isfinite(value) for value in (low, middle, high)):
        return "not bounded above"
    return estimate(middle, low, high, limit.unit)


def reach(effect: HiddenEffect) -> float:
    """How far it could move the limit, dB."""
    return max(abs(shift) for shift in effect.shift_db)


def moves(effect: HiddenEffect) -> str:
    """What it does to the limit, if it is there: 90 % interval."""
    return f"{db(effect.shift_db[0])} to {db(effect.shift_db[2])} dB"


def size(effect: HiddenEffect) -> str:
    """The size that it does not exceed, in words."""
    return f"up to {strength(effect)}"


def strength(effect: HiddenEffect) -> str:
    """The size that it does not exceed, with its unit."""
    return amount(effect.strength_q95, effect.unit)


def amount(strength: float, unit: str) -> str:
    """A strength with its unit; shares in per cent."""
    return quantity(strength, unit, digits=2) if unit else f"{100 * strength:.2g} %"


def db(shift: float) -> str:
    """With its sign."""
    return minus(f"{round(shift, 3) + 0.0:+.3f}").replace("+0.000", "0.000")
