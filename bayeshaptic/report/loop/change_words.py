"""What an explanation changed: the error, the noise, the limit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.quantities import decibel, estimate, minus, pure, quantity, scale
from bayeshaptic.report.numbers.unstated import unstated

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


def part(closed: Closed) -> str:
    """Which part of the recording the numbers after are of; empty where it is all of it."""
    changes = any(effect.family == "time-varying" for effect in closed.effects)
    return ", in the worst part alone, whose response scatters more" if changes else ""


def two_measurements(closed: Closed) -> str:
    """Which columns of the errors can be compared, where there are two measurements."""
    other = (
        "the part of the recording that the limit is of"
        if part(closed)
        else "the response with what was found taken off it, or mended"
    )
    return (
        "The last two columns are of one measurement and one noise, and can be compared: they are "
        f"beside {other}. The model as declared was fitted to the first column's and is put "
        "beside the other as it is."
    )


def error_change(closed: Closed) -> str:
    """The error of the two models beside one measurement, as part of a sentence."""
    key, what = "held_out_weighted_rms", "held-out error"
    if key not in closed.before:  # in closed loop nothing can be held out
        key, what = "weighted_rms", "error"
    alike = closed.before if closed.before_like_after is None else closed.before_like_after
    before, after = alike[key], closed.after[key]
    where = " in the worst part" if part(closed) else ""
    same = 0.005  # relative change of an error that is not worth a word
    if abs(after / before - 1) < same:
        return f"left the {what} at {quantity(after, '')} times the noise{where}"
    verb = "cut" if after < before else "raised"
    old, new = quantity(before, ""), quantity(after, "")
    return f"{verb} the {what} from {old} to {new} times the noise{where}"


def noise_change(closed: Closed) -> str:
    """What had passed for noise: a force that is not linear scatters the response."""
    old, new = closed.base.fit, closed.analysis.fit
    if old.windows is None or new.windows is None:
        return ""
    if len(old.windows.scatter) != len(new.windows.scatter):
        return ""
    ratio = new.likelihood.noise_variance / old.likelihood.noise_variance
    share = float(np.sqrt(np.median(ratio)))
    less = 0.9  # of the noise, to be worth a word
    if share >= less:
        return ""
    return f", and cut the noise itself to {pure(share, 2)} of what it seemed"


def limit_change(closed: Closed) -> str:
    """What became of the median limit, as part of a sentence."""
    if any(unstated(one) is not None for one in (closed.base, closed.analysis)):
        return "K_CR is not stated"
    before, after = (e["critical_stiffness"] for e in (closed.before, closed.after))
    unit = closed.analysis.limit.unit
    old, new = before["q50"], after["q50"]
    if not (old > 0 and new > 0 and math.isfinite(old) and math.isfinite(new)):
        return f"K_CR went from {quantity(old, unit)} to {quantity(new, unit)}"
    step = decibel(new) - decibel(old)
    same_db = 0.05
    if abs(step) < same_db:
        return f"K_CR stayed at {estimate(new, after['q05'], after['q95'], unit)}"
    row = scale((old, new), unit)
    gap = abs(new - old) / 5
    old_text, new_text = (row.number(value, gap, least=3) for value in (old, new))
    change = minus(f"{step:+.1f} dB")
    return f"K_CR moved from {old_text} to {new_text} {row.unit} ({change})"


def moved(closed: Closed) -> str:
    """The same as a sentence of its own."""
    text = limit_change(closed)
    return text.replace("K_CR", "With that the median limit", 1)
