"""What could hide, in words and rows of a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.quantities import percent, quantity, spread_of
from bayeshaptic.report.numbers.hidden import FEW, interval_of, moves, reach, size, strength

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.hidden.hidden import Hidden, HiddenEffect
    from bayeshaptic.report.numbers.rows import Rows

# Which fact or recording would rule an effect out; of the others, what tells them from their likes.
_RULED_OUT = {
    "extra_delay": "measure the delay from command to force with an oscilloscope, and give it with "
    "its standard deviation (--delay-s, --delay-sd-s)",
    "actuator_lag": "measure the motor's current after a step of the command, and give the delay "
    "that it adds (--delay-s, --delay-sd-s)",
    "position_filter": "look up which filters the position goes through, and give the delay that "
    "they add (--delay-s, --delay-sd-s)",
    "coulomb_friction": "record at half and at twice the force: friction is a larger share of "
    "the smaller one",
    "centring_stiffness": "push the device by a known force and see whether it comes back",
}


def lead(analysis: Analysis, hidden: Hidden) -> str:
    """What the section says first: the two limits, and what stands between them."""
    declared, limit = (interval_of(one) for one in (hidden.declared, analysis.limit))
    allowed = (
        "Allowing for that leaves the interval as it is, to the digits shown."
        if declared == limit
        else f"With that allowed for, the critical stiffness is {limit}."
    )
    return (
        f"If the model is exact, the critical stiffness is {declared}. No device is exactly its "
        f"model: what the tests of this recording cannot see may still move the limit. {allowed} "
        "All of this page is of the limit with that allowed for. With a probability of "
        f"{percent(hidden.nothing)} nothing hides."
    )


def largest(hidden: Hidden) -> str:
    """The effect that counts most, and what would rule it out."""
    first = next(iter(hidden.effects), None)
    if first is None or reach(first) < FEW:
        return "Nothing that could hide here would move the limit by more than 0.005 dB."
    return (
        f"What counts most: {first.title}. It is there with a probability of "
        f"{percent(first.probability)}, and then it is {size(first)} ({first.what}) and moves the "
        "limit by "
        f"{moves(first)}.{ruled_out(first)} A longer recording, or one with more force, "
        "shrinks it as it does all the others."
    )


def ruled_out(effect: HiddenEffect) -> str:
    """The fact or the recording that would rule an effect out; empty where more data would."""
    how = _RULED_OUT.get(effect.name, effect.told_apart_by)
    return f" To rule it out, {how}." if how else ""


def rows(hidden: Hidden) -> Rows:
    """A row an effect: probability before and after, largest size, what it does to the limit."""
    return tuple(
        (
            effect.title,
            percent(effect.prior),
            percent(effect.probability),
            strength(effect),
            effect.what,
            moves(effect).removesuffix(" dB"),
        )
        for effect in hidden.effects
    )


def sensitivity(analysis: Analysis, hidden: Hidden) -> Rows:
    """Points of K_CR for halved, given and doubled prior probabilities, and without."""
    unit, levels = analysis.limit.unit, [0.01, 0.05, 0.5, 0.95]
    cases = [("none: the model is exact", hidden.declared.quantile(levels))]
    low, high = analysis.limit.quantile([0.05, 0.95])
    spread = (
        spread_of(low, high) / 10
    )  # one digit more than an interval has: rows are to be compared
    for factor, found in sorted(
        {1.0: analysis.limit.quantile(levels), **hidden.sensitivity}.items()
    ):
        name = {0.5: "halved", 1.0: "as given", 2.0: "doubled"}.get(factor, f"times {factor:g}")
        cases.append((name, found))
    return tuple(
        (name, *(quantity(float(value), unit, spread, digits=4) for value in found))
        for name, found in cases
    )
