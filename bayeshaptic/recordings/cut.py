"""The part of a file that is read: rows, or seconds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError

Span = tuple[float | None, float | None]


@dataclass(frozen=True)
class Cut:
    """The part of a file that is read; see `read_recording`."""

    rows: Span | None
    seconds: Span | None

    def __post_init__(self) -> None:
        if self.rows is not None and self.seconds is not None:
            raise InputError("both rows and seconds are given; leave one of them out")
        for row in self.rows or ():
            if row is not None and (row < 1 or row != int(row)):
                raise InputError(f"rows are counted from 1 in whole numbers, and {row:g} is none")

    def apply(
        self, signals: dict[str, NDArray[np.float64]], period_s: float | None, path: Path
    ) -> dict[str, NDArray[np.float64]]:
        """The signals' part, each of them if they differ in length."""
        start, stop = 0, len(signals["force"])
        if self.rows is not None:
            first, last = self.rows
            start, stop = int(first or 1) - 1, stop if last is None else int(last)
        if self.seconds is not None:
            low, high = self.seconds
            time = signals.get("time")
            clock = np.arange(stop) * (period_s or np.nan) if time is None else time - time[0]
            inside = (clock >= (low or 0.0)) & (clock <= (np.inf if high is None else high))
            found = np.flatnonzero(inside)
            start, stop = (int(found[0]), int(found[-1]) + 1) if len(found) else (0, 0)
        if self.rows is None and self.seconds is None:
            return signals
        cut = {role: values[start:stop] for role, values in signals.items()}
        if any(len(values) == 0 for values in cut.values()):
            count = len(signals["force"])
            raise InputError(f"{path}: nothing is left of its {count} rows by --rows or --seconds")
        return cut
