"""Taking the columns that all windows have in common off deviations, compiled."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats


@kernel
def take_off(directions: Floats, across: Floats, left: Floats) -> None:
    """What is along orthonormal `directions`, (S, n), `across` their transpose; `left` is (B, n).

    One vector after the other, so that none depends on how many are asked at once.
    """
    count, size = directions.shape
    along = np.empty(count)
    for row in range(len(left)):
        along[:] = 0.0
        for place in range(size):
            value = left[row, place]
            for one in range(count):
                along[one] += across[place, one] * value
        for one in range(count):
            share = along[one]
            for place in range(size):
                left[row, place] -= share * directions[one, place]
