"""Which period the loop has, where a force that is held for several rows leaves it open."""

from __future__ import annotations

from collections.abc import Iterable

from bayeshaptic.devices import Device
from bayeshaptic.errors import Notice
from bayeshaptic.recordings.signals.rows.timing import LOOP
from bayeshaptic.recordings.signals.rows.uneven_rows import UNEVEN


def doubts_of_the_loop(notices: Iterable[Notice]) -> list[str]:
    """Why no stiffness follows where a warning doubts that the loop has the period of the rows.

    The limit of a loop that is slower is lower, by as many times as its period is longer where
    delay and damping alone decide.
    """
    doubts = [n for n in notices if n.topic == "period" and LOOP in n.about]
    if not doubts:
        return []
    if any(UNEVEN in n.about for n in doubts):
        return [
            "its rows are not evenly apart in time, as where a log writes the newest row of a loop "
            "of another rate: write every row of the loop down"
        ]
    return [
        "the force is held for several rows, so that the loop's period may be longer than that of "
        "a row and the limit lower: say the loop's period with --period-s"
    ]


def without_doubt(
    notices: Iterable[Notice], period_s: float, device: Device | None
) -> tuple[Notice, ...]:
    """The same, without that doubt where the device's file has the period of the rows."""
    said = device.period_s if device is not None else None
    if not said or abs(period_s / said - 1) > 0.01:
        return tuple(notices)
    return tuple(n for n in notices if not (n.topic == "period" and LOOP in n.about))
