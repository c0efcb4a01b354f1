"""What stands behind an ETFE that was read from a table: its rows."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.windows import Reference, Windows


@dataclass(frozen=True, eq=False)
class TableSpectra:
    """Rows of a frequency-response table.

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
    value : complex ndarray, shape (L,)
    variance : ndarray, shape (L,)
        E|value - truth|^2.
    averages : ndarray, shape (L,)
        Number of averages behind the variance; infinite where it is known exactly.
    own_variance : ndarray, shape (L,), or None
        Where the table is of a structure without a loop, and shows nothing of what lies between the
        samples: the variance that it has beside a model that knows of that.
    """

    frequency_hz: NDArray[Any] = field(repr=False)
    value: NDArray[Any] = field(repr=False)
    variance: NDArray[Any] = field(repr=False)
    averages: NDArray[Any] = field(repr=False)
    own_variance: NDArray[Any] | None = field(default=None, repr=False)

    @property
    def lines(self) -> int:
        return len(self.frequency_hz)

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """One window a row; the reference is not needed, and there can be no inputs."""
        lines = np.minimum(self.averages, 1e6)
        return Windows(
            frequency_hz=self.frequency_hz[:, None],
            design=np.ones((self.lines, 1, 1), dtype=complex),
            target=self.value[:, None],
            scatter=(lines - 1) * self.variance,
            lines=lines,
        )
