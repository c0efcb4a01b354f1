"""Feedback: whether a recording has it, and the controller, as far as it is known."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.devices.table import Table
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.types import Floats

UNDECIDED = "undecided"  # what a warning is about where feedback is only a doubt
OR_NOISE = "or noise of a band"  # what it is about where noise of a band looks the same
_KEYS = ("law", "proportional", "derivative", "integral", "filter_hz")


@dataclass(frozen=True)
class Feedback:
    """The law u[k] = ... - P y[k] - I T sum y - D d[k] of a PID controller.

    d is the first difference of the position over the period, low-passed:
    d[k] = a d[k-1] + (1 - a) (y[k] - y[k-1]) / T with a = exp(-2 pi filter_hz T).  What it follows
    need not be known.

    Attributes
    ----------
    proportional : float
        Force over position.
    derivative : float
        Force over velocity.
    integral : float
        Force over the integral of position, a second.
    filter_hz : float or None
        None: the difference is not filtered.
    """

    proportional: float
    derivative: float = 0.0
    integral: float = 0.0
    filter_hz: float | None = None

    def law(self, period_s: float) -> tuple[Floats, Floats]:
        """Numerator and denominator of force over -position, in powers of 1/z."""
        keep = np.exp(-2 * np.pi * self.filter_hz * period_s) if self.filter_hz else 0.0
        slope = (1 - keep) * self.derivative / period_s
        lag, difference = np.array([1.0, -keep]), np.array([1.0, -1.0])
        above = self.proportional * lag + slope * difference
        if self.integral == 0:
            return above, lag
        above = np.convolve(above, difference) + self.integral * period_s * np.append(lag, 0.0)
        return above, np.convolve(lag, difference)


def has_feedback(notices: Iterable[Notice]) -> bool:
    """Whether a warning says that the force was computed from the motion."""
    return any(n.topic == "feedback" and n.level == "warning" for n in notices)


def is_certain(notices: Iterable[Notice]) -> bool:
    """Whether there is feedback, and not only a doubt that cannot be decided."""
    found = [n for n in notices if n.topic == "feedback" and n.level == "warning"]
    return bool(found) and not any(UNDECIDED in n.about for n in found)


def doubts(notices: Iterable[Notice]) -> tuple[str, ...]:
    """What speaks for an open loop all the same: `UNDECIDED`, `OR_NOISE`, or nothing."""
    about = {what for n in notices if n.topic == "feedback" for what in n.about}
    return tuple(doubt for doubt in (UNDECIDED, OR_NOISE) if doubt in about)


def how_computed(notices: Iterable[Notice]) -> str:
    """Whether the force was computed from the motion, as far as anybody knows, for a sentence."""
    doubted = doubts(notices)
    if OR_NOISE in doubted:
        return "was computed from the motion, or is noise of a band"
    return f"{'may have been' if doubted else 'was'} computed from the motion"


def told(feedback: Feedback | None, notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """`notices`, with the warning where feedback was declared and nothing in the data shows it."""
    if feedback is None or has_feedback(notices):
        return notices
    text = "The force was computed from the motion: [feedback] says by which controller."
    return (*notices, Notice("warning", "feedback", text))


def read_feedback(content: object, where: str) -> Feedback | None:
    """The ``[feedback]`` table of a study; None without one.

    Raises
    ------
    InputError
        For another law than "pid", no proportional gain, and unknown or impossible values.
    """
    if content is None:
        return None
    table = Table(content, where, known=_KEYS)
    table.text("law", ("pid",))
    proportional = table.number("proportional")
    if proportional is None:
        raise InputError(f"{where} needs a proportional gain, in force over position")
    derivative, integral = (table.number(key) or 0.0 for key in ("derivative", "integral"))
    filter_hz = table.number("filter_hz", lowest=0.0, above=True)
    return Feedback(proportional, derivative, integral, filter_hz)
