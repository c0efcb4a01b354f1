"""Which period the loop has, where a force that is held for several rows leaves it open."""

from __future__ import annotations

from collections.abc import Iterable

from bayeshaptic.devices import Device
from bayeshaptic.errors import Notice
from bayeshaptic.recordings.signals.timing import LOOP


def doubts_of_the_loop(notices: Iterable[Notice]) -> list[str]:
    """Why no stiffness follows where a warning doubts that the loop has the period of the rows.

    The limit of a loop that is slower is lower, by as many times as its period is longer where
    delay and damping alone decide.
    """
    if not any(n.topic == "period" and LOOP in n.about for n in notices):
        return []
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
