"""Masses joined by springs and dampers, in any arrangement, for a batch of parameter vectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.models.response.dynamic_link import Index
from bayeshaptic.models.response.spanning import (
    GROUND,
    Edges,
    ends_of,
    merged,
    node_of,
    signs_of,
    spanning_trees,
    with_edge,
)
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, add
from bayeshaptic.types import Floats

Pair = tuple[int, int | None]
"""Two masses, or a mass and the ground (None)."""


@dataclass(frozen=True)
class Link:
    """A spring and a damper side by side, between two masses or a mass and the ground (None).

    `damping` and `stiffness` have shape (B,).
    """

    first: int
    second: int | None
    damping: Floats
    stiffness: Floats


@dataclass(frozen=True)
class Mechanism:
    """Masses on a line; the motor pushes one of them and the encoder reads its position.

    Attributes
    ----------
    masses : tuple of ndarray, each of shape (B,)
    links : tuple of Link
    driven : int
        The motor's mass, 0 in every model of the paper.
    hand : int or None
        The mass of the hand that holds the device; it leans on the ground whatever the device
        stands on.
    frame : int or None
        The mass that the device is built on: the motor pushes against it, the encoder reads from
        it.  None: the ground itself.
    """

    masses: tuple[Floats, ...]
    links: tuple[Link, ...]
    driven: int = 0
    hand: int | None = None
    frame: int | None = None

    @property
    def batch(self) -> int:
        return len(self.masses[0])

    @property
    def drive(self) -> Pair:
        """What the motor pushes apart, and the encoder reads between."""
        return (self.driven, self.frame)

    def rows(self, index: Index) -> Mechanism:
        """A part of the batch."""
        links = tuple(
            replace(link, damping=link.damping[index], stiffness=link.stiffness[index])
            for link in self.links
        )
        return replace(self, masses=tuple(mass[index] for mass in self.masses), links=links)

    def with_mass(self, mass: Floats, on: int, damping: Floats, stiffness: Floats) -> Mechanism:
        """With one more mass, joined to the mass number `on`."""
        link = Link(len(self.masses), on, damping, stiffness)
        return replace(self, masses=(*self.masses, mass), links=(*self.links, link))

    def with_link(self, link: Link) -> Mechanism:
        return replace(self, links=(*self.links, link))

    def with_frame(self, mass: Floats, damping: Floats, stiffness: Floats) -> Mechanism:
        """On a frame that moves on a spring and a damper, instead of on what carried it before."""
        frame = len(self.masses)
        links = tuple(
            replace(link, second=frame) if self._on_frame(link) else link for link in self.links
        )
        feet = Link(frame, self.frame, damping, stiffness)
        return replace(self, masses=(*self.masses, mass), links=(*links, feet), frame=frame)

    def _on_frame(self, link: Link) -> bool:
        return link.second == self.frame and link.first != self.hand

    def mutual(self, first: Pair, second: Pair) -> Polynomial:
        """Numerator, over `transfer`'s denominator, of the stretch of one pair by another's force.

        Reciprocal: either may be the one that a force pushes apart; see `signs_of`.
        """
        edges, total = self._edges(), np.zeros((1, self.batch))
        for pair, sign in signs_of(ends_of(first), ends_of(second)).items():
            total = add(total, sign * spanning_trees(merged(edges, pair)))
        return total

    def transfer(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of position over force (G, G1 and H1 of the paper)."""
        return self.transfer_to(self.driven)

    def transfer_to(self, mass: int) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of a mass's position, seen from the frame, over the force."""
        return self.mutual(self.drive, (mass, self.frame)), spanning_trees(self._edges())

    def _edges(self) -> Edges:
        """The network: springs and dampers between masses, and every mass against the ground."""
        zero = np.zeros(self.batch)
        edges: Edges = {}
        for number, mass in enumerate(self.masses):
            edges = with_edge(edges, number, GROUND, np.stack([zero, zero, mass]))
        for link in self.links:
            both = np.stack([link.stiffness, link.damping])
            edges = with_edge(edges, link.first, node_of(link.second), both)
        return edges

    def state_matrix(self) -> Floats:
        """A of d/dt (positions, velocities) = A (positions, velocities), shape (B, 2n, 2n)."""
        n = len(self.masses)
        stiffness = np.zeros((self.batch, n, n))
        damping = np.zeros((self.batch, n, n))
        for link in self.links:
            for matrix, value in ((stiffness, link.stiffness), (damping, link.damping)):
                matrix[:, link.first, link.first] += value
                if link.second is not None:
                    matrix[:, link.second, link.second] += value
                    matrix[:, link.first, link.second] -= value
                    matrix[:, link.second, link.first] -= value
        masses = np.stack(self.masses, axis=-1)[:, :, None]
        state = np.zeros((self.batch, 2 * n, 2 * n))
        state[:, :n, n:] = np.eye(n)
        state[:, n:, :n] = -stiffness / masses
        state[:, n:, n:] = -damping / masses
        return state

    def drive_vector(self) -> Floats:
        """+1 at the motor's mass, -1 at the frame: how force enters and position is read, (n,)."""
        vector = np.zeros(len(self.masses))
        vector[self.driven] = 1.0
        if self.frame is not None:
            vector[self.frame] = -1.0
        return vector
