"""Masses joined by springs and dampers, in any arrangement, for a batch of parameter vectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models.polynomial import Polynomial, add, determinant

Floats = NDArray[np.float64]


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
    """Masses on a line, force on one of them, position of one of them measured.

    Attributes
    ----------
    masses : tuple of ndarray, each of shape (B,)
    links : tuple of Link
    driven, measured : int
        The mass that the motor pushes and the one that the encoder reads; 0 for both in every
        model of the paper.
    """

    masses: tuple[Floats, ...]
    links: tuple[Link, ...]
    driven: int = 0
    measured: int = 0

    @property
    def batch(self) -> int:
        return len(self.masses[0])

    def with_mass(self, mass: Floats, on: int, damping: Floats, stiffness: Floats) -> Mechanism:
        """With one more mass, joined to the mass number `on`."""
        link = Link(len(self.masses), on, damping, stiffness)
        return replace(self, masses=(*self.masses, mass), links=(*self.links, link))

    def with_link(self, link: Link) -> Mechanism:
        return replace(self, links=(*self.links, link))

    def dynamic_stiffness(self) -> list[list[Polynomial | None]]:
        """The matrix M s^2 + C s + K as polynomials in s; None where it is zero by structure."""
        n = len(self.masses)
        zero = np.zeros(self.batch)
        matrix: list[list[Polynomial | None]] = [[None] * n for _ in range(n)]

        def put(i: int, j: int, term: Polynomial) -> None:
            entry = matrix[i][j]
            matrix[i][j] = term if entry is None else add(entry, term)

        for i, mass in enumerate(self.masses):
            put(i, i, np.stack([zero, zero, mass]))
        for link in self.links:
            term = np.stack([link.stiffness, link.damping])
            put(link.first, link.first, term)
            if link.second is not None:
                put(link.second, link.second, term)
                put(link.first, link.second, -term)
                put(link.second, link.first, -term)
        return matrix

    def transfer(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of position over force (G, G1 and H1 of the paper)."""
        return self.transfer_to(self.measured)

    def transfer_to(self, mass: int) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of the position of the mass number `mass` over the force."""
        matrix = self.dynamic_stiffness()
        denominator = determinant(matrix)
        minor = determinant(
            [
                [entry for j, entry in enumerate(row) if j != mass]
                for i, row in enumerate(matrix)
                if i != self.driven
            ]
        )
        assert denominator is not None
        if minor is None:  # no path from the force to this mass
            minor = np.zeros((1, self.batch))
        sign = -1.0 if (mass + self.driven) % 2 else 1.0
        return np.broadcast_to(sign * minor, (len(minor), self.batch)), denominator

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
