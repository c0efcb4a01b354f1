"""Numerator and denominator of a mechanism's transfer function, compiled.

`Mechanism.transfer` walks over the spanning trees of the network with arrays.  Here the walk is
taken once for each arrangement of masses, with a record of what it adds and multiplies, and the
record is run for every parameter vector by itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.spanning import (
    GROUND,
    Algebra,
    Pair,
    merged,
    spanning_trees,
    with_edge,
)
from bayeshaptic.types import Floats, Ints

ADD, MULTIPLY = 0, 1
_EDGE = 3  # coefficients: stiffness, damping, mass


@dataclass(frozen=True)
class Record:
    """What is to be done with the edges of a network to have its transfer function.

    Attributes
    ----------
    edges : mapping
        Two nodes, the smaller first, to the number of their edge.
    steps : ndarray of int, shape (N, 4)
        ADD or MULTIPLY, the result, and the two polynomials, by their numbers: 0 is one, then the
        edges, then the results.
    lengths : ndarray of int
        How many coefficients each polynomial has.
    numerator, denominator : int
    """

    edges: Mapping[Pair, int]
    steps: Ints
    lengths: Ints
    numerator: int
    denominator: int


@dataclass
class _Recorder:
    """An algebra that writes down what it is asked for, the same thing once."""

    lengths: list[int]
    steps: dict[tuple[int, int, int], int] = field(default_factory=dict)

    def add(self, a: int, b: int) -> int:
        return self._step(ADD, a, b, max(self.lengths[a], self.lengths[b]))

    def multiply(self, a: int, b: int) -> int:
        if a == 0 or b == 0:  # one
            return a + b
        return self._step(MULTIPLY, a, b, self.lengths[a] + self.lengths[b] - 1)

    def _step(self, kind: int, a: int, b: int, length: int) -> int:
        step = (kind, min(a, b), max(a, b))
        if step not in self.steps:
            self.steps[step] = len(self.lengths)
            self.lengths.append(length)
        return self.steps[step]


def transfer(mechanism: Mechanism) -> tuple[Floats, Floats]:
    """What `Mechanism.transfer` gives, the batch first: shapes (B, degree + 1)."""
    from bayeshaptic.models.response.kernels.transfer import run

    pairs = tuple((link.first, _node(link.second)) for link in mechanism.links)
    drive = (mechanism.driven, _node(mechanism.frame))
    record = recorded(len(mechanism.masses), pairs, drive)
    edges = np.zeros((mechanism.batch, len(record.edges), _EDGE))
    for number, mass in enumerate(mechanism.masses):
        edges[:, record.edges[GROUND, number], 2] += mass
    for link, (i, j) in zip(mechanism.links, pairs, strict=True):
        edge = record.edges[min(i, j), max(i, j)]
        edges[:, edge, 0] += link.stiffness
        edges[:, edge, 1] += link.damping
    numerator = np.empty((mechanism.batch, record.lengths[record.numerator]))
    denominator = np.empty((mechanism.batch, record.lengths[record.denominator]))
    wanted = (record.numerator, record.denominator)
    run(record.steps, record.lengths, edges, wanted, numerator, denominator)
    return numerator, denominator


@lru_cache(maxsize=256)
def recorded(masses: int, links: tuple[Pair, ...], drive: Pair) -> Record:
    """The record for an arrangement of masses and links, GROUND being one of the nodes."""
    ends = {(GROUND, mass): True for mass in range(masses)}
    for i, j in links:
        ends.setdefault((min(i, j), max(i, j)), False)
    recorder = _Recorder([1, *(_EDGE if heavy else 2 for heavy in ends.values())])
    algebra = Algebra(0, recorder.add, recorder.multiply)
    edges: Mapping[Pair, int] = {}
    for number, (i, j) in enumerate(ends):
        edges = with_edge(edges, i, j, number + 1, algebra)
    numerator = spanning_trees(merged(edges, drive, algebra), algebra)
    denominator = spanning_trees(edges, algebra)
    steps = [(kind, out, a, b) for (kind, a, b), out in recorder.steps.items()]
    return Record(
        {pair: number for number, pair in enumerate(ends)},
        np.array(steps, int).reshape(-1, 4),
        np.array(recorder.lengths),
        numerator,
        denominator,
    )


def _node(mass: int | None) -> int:
    return GROUND if mass is None else mass
