"""Which period the loop has, where a force that is held, or rows that are uneven, leave it open."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from bayeshaptic.devices import Device
from bayeshaptic.errors import Notice
from bayeshaptic.recordings.signals.rows.timing import LOOP
from bayeshaptic.recordings.signals.rows.uneven_rows import UNEVEN


def rows_are_uneven(notices: Iterable[Notice]) -> bool:
    """Whether rows are early and late by turns, in a loop whose period nobody said."""
    return any(n.topic == "period" and {LOOP, UNEVEN} <= set(n.about) for n in notices)


def doubts_of_the_loop(notices: Iterable[Notice]) -> list[str]:
    """Why no stiffness follows where a warning doubts that the loop has the period of the rows.

    The limit of a loop that is slower is lower, by as many times as its period is longer where
    delay and damping alone decide.
    """
    told = tuple(notices)
    if rows_are_uneven(told):
        return [
            "its rows are not evenly apart in time, as where a log writes the newest row of a loop "
            "of another rate, or a controller's outer loop runs at every few of them only: then "
            "say the period of the rows with --period-s"
        ]
    if not any(n.topic == "period" and LOOP in n.about for n in told):
        return []
    return [
        "the force is held for several rows, so that the loop's period may be longer than that of "
        "a row and the limit lower: say the loop's period with --period-s"
    ]


def without_doubt(
    notices: Iterable[Notice], period_s: float, device: Device | None
) -> tuple[Notice, ...]:
    """The same, without that doubt where the device's file has the period of the rows."""
    told = tuple(notices)
    said = device.period_s if device is not None else None
    if not said or abs(period_s / said - 1) > 0.01:
        return told
    uneven = tuple(replace(n, about=(UNEVEN,)) for n in told if rows_are_uneven([n]))
    return tuple(n for n in told if not (n.topic == "period" and LOOP in n.about)) + uneven
