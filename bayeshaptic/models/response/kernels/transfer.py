"""The compiled part of `../transfer.py`."""

from __future__ import annotations

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats, Ints


@kernel
def run(steps: Ints, lengths: Ints, edges: Floats, wanted: Ints, found: Floats) -> None:
    """Do what a `Record` says for every row of `edges`, shape (B, E, 3).

    `found`, of shape (B, number wanted, longest), is filled as far as each polynomial reaches.
    """
    batch, count, _ = edges.shape
    values = np.zeros((len(lengths), lengths.max()))
    values[0, 0] = 1.0
    for row in range(batch):
        for edge in range(count):
            for power in range(lengths[edge + 1]):
                values[edge + 1, power] = edges[row, edge, power]
        for step in range(len(steps)):
            out, a, b = steps[step, 1], steps[step, 2], steps[step, 3]
            if steps[step, 0] == 0:
                for power in range(lengths[out]):
                    values[out, power] = 0.0
                for power in range(lengths[a]):
                    values[out, power] = values[a, power]
                for power in range(lengths[b]):
                    values[out, power] += values[b, power]
            else:
                for power in range(lengths[out]):
                    values[out, power] = 0.0
                for i in range(lengths[a]):
                    for j in range(lengths[b]):
                        values[out, i + j] += values[a, i] * values[b, j]
        for place in range(len(wanted)):
            for power in range(lengths[wanted[place]]):
                found[row, place, power] = values[wanted[place], power]
