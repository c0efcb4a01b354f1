"""Determinants of networks of masses, springs and dampers, without a single subtraction.

The dynamic stiffness matrix of masses joined by springs is a grounded Laplacian: its determinant is
the sum over all spanning trees of the product of their edges (Kirchhoff's matrix-tree theorem),
where a mass is an edge m s^2 to the ground.  All coefficients are sums of positive products, so
they are right to the last digits, and a zero (the rigid-body pole of a device that nobody holds)
is an exact zero.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any, Generic, TypeVar

import numpy as np

from bayeshaptic.numerics.polynomials.polynomial import Polynomial, add, multiply

GROUND = -1
Edge = tuple[int, int]
Edges = Mapping[Edge, Polynomial]
"""Two nodes, the smaller first, to the dynamic stiffness between them."""
P = TypeVar("P")


def node_of(mass: int | None) -> int:
    """A mass as a node of the network; None is the ground."""
    return GROUND if mass is None else mass


def ends_of(pair: tuple[int | None, int | None]) -> Edge:
    """Two masses as nodes."""
    return node_of(pair[0]), node_of(pair[1])


def signs_of(first: Edge, second: Edge) -> dict[Edge, float]:
    """Which nodes are made one for the stretch of one pair by another's force, with its factor.

    By the effective compliances R of the network, (R_il + R_jk - R_ik - R_jl) / 2 for the pairs ij
    and kl.
    """
    (i, j), (k, m) = first, second
    if (i, j) == (k, m):
        return {first: 1.0}
    signs = {(i, m): 0.5, (j, k): 0.5, (i, k): -0.5, (j, m): -0.5}
    return {pair: sign for pair, sign in signs.items() if pair[0] != pair[1]}


@dataclass(frozen=True)
class Algebra(Generic[P]):
    """How polynomials are added and multiplied: numbers, or a record of what is to be done."""

    one: P
    add: Callable[[P, P], P]
    multiply: Callable[[P, P], P]


NUMBERS: Algebra[Any] = Algebra(np.ones((1, 1)), add, multiply)


def with_edge(
    edges: Mapping[Edge, P], first: int, second: int, stiffness: P, algebra: Algebra[P] = NUMBERS
) -> Mapping[Edge, P]:
    """`edges` and one more, beside what joins the two nodes already."""
    pair = (min(first, second), max(first, second))
    known = edges.get(pair)
    return {**edges, pair: stiffness if known is None else algebra.add(known, stiffness)}


def merged(
    edges: Mapping[Edge, P], nodes: tuple[int, ...], algebra: Algebra[P] = NUMBERS
) -> Mapping[Edge, P]:
    """The network with some nodes made one, which goes by the name of the smallest of them."""
    keep = min(nodes)
    out: Mapping[Edge, P] = {}
    for (i, j), stiffness in edges.items():
        i, j = keep if i in nodes else i, keep if j in nodes else j
        if i != j:
            out = with_edge(out, i, j, stiffness, algebra)
    return out


def spanning_trees(edges: Mapping[Edge, P], algebra: Algebra[P] = NUMBERS) -> P:
    """The sum over all spanning trees of the products of their edges.

    Node by node, that with the fewest neighbours first: the trees in which it has exactly certain
    neighbours are those of the rest with these neighbours made one.
    """
    neighbours: dict[int, list[int]] = {}
    for i, j in edges:
        neighbours.setdefault(i, []).append(j)
        neighbours.setdefault(j, []).append(i)
    inner = [node for node in neighbours if node != GROUND]
    if not inner:
        return algebra.one
    node = min(inner, key=lambda n: len(neighbours[n]))
    own = {other: edges[min(node, other), max(node, other)] for other in neighbours[node]}
    rest = {pair: stiffness for pair, stiffness in edges.items() if node not in pair}
    total: P | None = None
    for size in range(2, len(own) + 1):
        for chosen in combinations(own, size):
            term = spanning_trees(merged(rest, chosen, algebra), algebra)
            for other in chosen:
                term = algebra.multiply(term, own[other])
            total = term if total is None else algebra.add(total, term)
    single = spanning_trees(rest, algebra)
    for_one = None
    for stiffness in own.values():
        for_one = stiffness if for_one is None else algebra.add(for_one, stiffness)
    assert for_one is not None
    term = algebra.multiply(for_one, single)
    return term if total is None else algebra.add(total, term)
