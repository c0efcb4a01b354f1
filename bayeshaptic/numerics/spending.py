"""What a computation has cost so far, counted where it is made, the same on every machine.

The unit is one value of a rational model at one frequency; what takes longer counts for more.  What
is spent inside `metered` counts towards its limit; nothing is ever stopped in the middle, but
whoever runs a list of things may ask before each whether it is still affordable.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bayeshaptic.types import Tick

RATE = 2.5e7
"""Evaluations that count as a second: what a busy core of 2020 does in searches, about."""
BUDGET_S = 40.0
"""What a search for what a model lacks may cost by default, in these nominal seconds."""


@dataclass
class Meter:
    """Evaluations spent, and what was left out for want of more.

    Attributes
    ----------
    limit : float
        Evaluations; infinite for no limit.
    spent : float
    skipped : list of str
        What was asked for when the limit was reached.
    tick : callable, optional
        Called with the title of whatever is tried next, for those who wait.
    """

    limit: float = float("inf")
    spent: float = 0.0
    skipped: list[str] = field(default_factory=list)
    tick: Tick | None = field(default=None, repr=False, compare=False)

    def affords(self, what: str) -> bool:
        """Whether the limit is not reached yet; if it is, `what` is put down as skipped."""
        if self.spent < self.limit:
            return True
        if what not in self.skipped:
            self.skipped.append(what)
        return False

    def trying(self, what: str) -> None:
        """Tell whoever waits that `what` is tried next."""
        if self.tick:
            self.tick(what)


_meter: ContextVar[Meter | None] = ContextVar("meter", default=None)


def spend(evaluations: float) -> None:
    """Count evaluations, where anybody does."""
    meter = _meter.get()
    if meter is not None:
        meter.spent += evaluations


@contextmanager
def counting(meter: Meter) -> Iterator[None]:
    """Count what is spent inside with `meter`; it counts for whoever counts around this, too."""
    token, before = _meter.set(meter), meter.spent
    try:
        yield
    finally:
        _meter.reset(token)
        spend(meter.spent - before)


@contextmanager
def metered(limit: float = float("inf")) -> Iterator[Meter]:
    """Count what is spent inside with a new meter."""
    meter = Meter(limit)
    with counting(meter):
        yield meter
