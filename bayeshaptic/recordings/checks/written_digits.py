"""Whether a position was written with so few digits that its steps depend on where it is."""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

_FEWEST, _MOST = 3, 7  # significant digits
_EXACT = 1e-9  # of a number that has no more digits
# Least share of rows that are written in the coarsest steps. How often such recordings occur:
# docs/door.md.
_SHARE = 0.02


def written_digits(recording: Recording) -> tuple[Notice, ...]:
    """A warning of significant digits that hide the motion where the position is large.

    ``%.4g`` writes 0.0001 near zero and 0.1 beyond a hundred.  Where that is more than the position
    moves by from row to row, it hangs and jumps.  A number of decimals, and an encoder's count, are
    the same everywhere.

    Parameters
    ----------
    recording : Recording
    """
    position = recording.position
    digits = next((n for n in range(_FEWEST, _MOST + 1) if _has_no_more(position, n)), None)
    if digits is None:
        return ()
    steps = _steps(position, digits)
    coarse, fine = float(steps.max()), float(steps.min())
    rows = steps[1:] == coarse
    moves = np.diff(position)[rows]
    if fine == coarse or rows.mean() < _SHARE or coarse < np.sqrt(np.mean(moves**2)):
        return ()
    if np.abs(position / coarse - np.round(position / coarse)).max() < 1e-6:
        return ()
    unit = recording.position_unit
    text = (
        f"The positions have {digits} significant digits: they go in steps of "
        f"{quantity(coarse, unit)} where they are large, more than from row to row, and of "
        f"{quantity(fine, unit)} near zero. So they hang and jump. Write more digits, or take off "
        "where the device began before they are written."
    )
    return (Notice("warning", "resolution", text),)


def _steps(position: Floats, digits: int) -> Floats:
    """The last of so many significant digits of each; of zero that of the smallest."""
    size = np.abs(position)
    size = np.where(size > 0, size, size[size > 0].min(initial=np.inf))
    return np.asarray(10.0 ** (np.floor(np.log10(size) + 1e-12) - digits + 1))


def _has_no_more(position: Floats, digits: int) -> bool:
    steps = _steps(position, digits)
    off = np.abs(position - steps * np.round(position / steps))
    return bool(np.all(off <= _EXACT * np.abs(position)))
