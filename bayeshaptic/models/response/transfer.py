"""Numerators and denominator of a mechanism's transfer functions, compiled.

`Mechanism.transfer` and `Mechanism.mutual` walk over the spanning trees of the network with arrays.
Here the walk is taken once for each arrangement of masses, with a record of what it adds and
multiplies, and the record is run for every parameter vector by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache, reduce

import numpy as np

from bayeshaptic.models.response.dynamic_link import DynamicLink
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.spanning import (
    GROUND,
    Algebra,
    Edge,
    ends_of,
    merged,
    node_of,
    signs_of,
    spanning_trees,
    with_edge,
)
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, add, multiply
from bayeshaptic.types import Floats, Ints

ADD, MULTIPLY = 0, 1
_EDGE = 3  # coefficients: stiffness, damping, mass
_WHOLE = (GROUND, GROUND)  # a node made one with itself: the network as it is
Merge = Edge | tuple[Edge, Edge]
"""Two nodes made one, or two such pairs."""
Mass = tuple[int | None, int | None]
"""Two masses, or a mass and the ground (None)."""


@dataclass(frozen=True)
class Record:
    """What is to be done with the edges of a network to have sums over its spanning trees.

    Attributes
    ----------
    edges : mapping
        Two nodes, the smaller first, to the number of their edge.
    steps : ndarray of int, shape (N, 4)
        ADD or MULTIPLY, the result, and the two polynomials, by their numbers: 0 is one, then the
        edges, then the results.
    lengths : ndarray of int
        How many coefficients each polynomial has.
    wanted : ndarray of int
        The numbers of what is asked for.
    """

    edges: Mapping[Edge, int]
    steps: Ints
    lengths: Ints
    wanted: Ints


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
    drive = ends_of(mechanism.drive)
    numerator, denominator = _trees(mechanism, (drive, _WHOLE))
    return numerator, denominator


def compliances(
    mechanism: Mechanism, couples: Sequence[tuple[Mass, Mass]]
) -> tuple[list[Polynomial], Polynomial]:
    """What `Mechanism.mutual` gives for each couple of pairs, and the denominator of all of them.

    Each of shape (degree + 1, B).
    """
    parts = [signs_of(ends_of(first), ends_of(second)) for first, second in couples]
    merges = tuple(dict.fromkeys(pair for part in parts for pair in part))
    *found, denominator = (p.T for p in _trees(mechanism, (*merges, _WHOLE)))
    known = dict(zip(merges, found, strict=True))
    zero = np.zeros((1, mechanism.batch))
    numerators = [
        reduce(add, (sign * known[pair] for pair, sign in part.items()), zero) for part in parts
    ]
    return numerators, denominator


def transfer_with_link(mechanism: Mechanism, link: DynamicLink) -> tuple[Floats, Floats]:
    """`transfer` with one more link whose law a/b is a ratio of polynomials.

    A determinant is linear in the stiffness of a link, and what this multiplies is the network with
    the link's ends made one: a sum over spanning trees again, without a subtraction.
    """
    assert link.ratio is not None
    drive, ends = ends_of(mechanism.drive), ends_of((link.first, link.second))
    both: tuple[Merge, ...] = () if set(drive) == set(ends) else ((drive, ends),)
    top, bottom, more_bottom, *more_top = (
        p.T for p in _trees(mechanism, (drive, _WHOLE, ends, *both))
    )
    above, below = link.ratio
    top, bottom = multiply(below, top), multiply(below, bottom)
    for more in more_top:  # none where the motor pushes on the link itself
        top = add(top, multiply(above, more))
    return top.T, add(bottom, multiply(above, more_bottom)).T


def _trees(mechanism: Mechanism, merges: tuple[Merge, ...]) -> list[Floats]:
    """The sum over the spanning trees with nodes made one, (B, degree + 1) for each merge."""
    from bayeshaptic.models.response.kernels.transfer import run

    pairs = tuple((link.first, node_of(link.second)) for link in mechanism.links)
    record = recorded(len(mechanism.masses), pairs, merges)
    edges = np.zeros((mechanism.batch, len(record.edges), _EDGE))
    for number, mass in enumerate(mechanism.masses):
        edges[:, record.edges[GROUND, number], 2] += mass
    for link, (i, j) in zip(mechanism.links, pairs, strict=True):
        edge = record.edges[min(i, j), max(i, j)]
        edges[:, edge, 0] += link.stiffness
        edges[:, edge, 1] += link.damping
    lengths = record.lengths[record.wanted]
    found = np.empty((mechanism.batch, len(lengths), int(lengths.max())))
    run(record.steps, record.lengths, edges, record.wanted, found)
    return [found[:, i, :length] for i, length in enumerate(lengths)]


@lru_cache(maxsize=256)
def recorded(masses: int, links: tuple[Edge, ...], merges: tuple[Merge, ...]) -> Record:
    """The record for an arrangement of masses and links, GROUND being one of the nodes."""
    ends = {(GROUND, mass): True for mass in range(masses)}
    for i, j in links:
        ends.setdefault((min(i, j), max(i, j)), False)
    recorder = _Recorder([1, *(_EDGE if heavy else 2 for heavy in ends.values())])
    algebra = Algebra(0, recorder.add, recorder.multiply)
    edges: Mapping[Edge, int] = {}
    for number, (i, j) in enumerate(ends):
        edges = with_edge(edges, i, j, number + 1, algebra)
    wanted = [spanning_trees(_merged(edges, merge, algebra), algebra) for merge in merges]
    steps = [(kind, out, a, b) for (kind, a, b), out in recorder.steps.items()]
    return Record(
        {pair: number for number, pair in enumerate(ends)},
        np.array(steps, int).reshape(-1, 4),
        np.array(recorder.lengths),
        np.array(wanted),
    )


def _merged(edges: Mapping[Edge, int], merge: Merge, algebra: Algebra[int]) -> Mapping[Edge, int]:
    pairs = [pair for pair in merge if isinstance(pair, tuple)]
    if not pairs:
        return merged(edges, merge, algebra)  # type: ignore[arg-type]
    first, second = pairs
    if set(first) & set(second):
        return merged(edges, tuple({*first, *second}), algebra)
    return merged(merged(edges, first, algebra), second, algebra)
