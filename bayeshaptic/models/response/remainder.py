r"""What dynamic links add to a response that is otherwise rational.

With A(s) the dynamic stiffness matrix of the mechanism alone, a link of dynamic stiffness
lambda(s) between two masses is an update of rank one, and by Sherman and Morrison

.. math:: \Delta P = - \frac{\lambda h_{0e}^2}{1 + \lambda h_{ee}},

h the compliances of A between the drive and the link's own pair of masses, which are ratios of
polynomials.  Several links are added one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.models.response.dynamic_link import DynamicLink, Index
from bayeshaptic.models.response.filters import Filter
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.transfer import compliances
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, evaluate
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class Remainder:
    """The response of a system minus that of its rational part, both without delay and hold.

    Attributes
    ----------
    links : tuple of DynamicLink
    compliances : mapping of (int, int) to ndarray
        Numerators of the compliances between the drive (number 0) and the links' pairs of masses
        (from 1 on), the smaller number first.
    denominator : ndarray, shape (degree + 1, B)
        Of all of them.
    filters : tuple of Filter
    """

    links: tuple[DynamicLink, ...]
    compliances: Mapping[tuple[int, int], Polynomial]
    denominator: Polynomial
    filters: tuple[Filter, ...]

    def rows(self, index: Index) -> Remainder:
        """A part of the batch."""
        return Remainder(
            tuple(link.rows(index) for link in self.links),
            {pair: numerator[:, index] for pair, numerator in self.compliances.items()},
            self.denominator[:, index],
            tuple(factor.rows(index) for factor in self.filters),
        )

    def at(self, s: Complexes) -> Complexes:
        """Values at points `s` of shape (..., 1) or (..., B); shape (..., B)."""
        total, _ = self._add_links(s)
        for factor in self.filters:
            total *= evaluate(factor.numerator, s) / evaluate(factor.denominator, s)
        return total

    def on_axis(self, omega: Floats) -> Complexes:
        """Values over s at s = j omega, of shape (L,) for the whole batch, or (L, B); (L, B)."""
        s, omega = self._points(omega)
        if len(self.links) > 1:
            total, _ = self._with_links(s, omega)
        else:
            total = self._with_link(s, omega)
        for factor in self.filters:
            total *= evaluate(factor.numerator, s) / evaluate(factor.denominator, s)
        return total

    def return_difference(self, omega: Floats) -> Complexes:
        """Characteristic function with the links over that without, as `on_axis`."""
        s, omega = self._points(omega)
        if len(self.links) > 1:
            return self._with_links(s, omega)[1]
        from bayeshaptic.models.response.kernels.remainder import return_difference

        stiffness = self.links[0].stiffness(s)
        found = np.empty_like(stiffness)
        denominator, own = self._polynomials((1, 1))
        return_difference(omega, denominator, own, real_pairs(stiffness), real_pairs(found))
        return found

    def _with_link(self, s: Complexes, omega: Floats) -> Complexes:
        """What a single link adds, over s."""
        from bayeshaptic.models.response.kernels.remainder import add_link

        stiffness = self.links[0].stiffness(s)
        total = np.empty_like(stiffness)
        denominator, mutual, own = self._polynomials((0, 1), (1, 1))
        add_link(omega, denominator, mutual, own, real_pairs(stiffness), real_pairs(total))
        return total

    def _with_links(self, s: Complexes, omega: Floats) -> tuple[Complexes, Complexes]:
        """`_add_links` on the axis, the first over s."""
        from bayeshaptic.models.response.kernels.remainder import add_links

        stiffness = np.stack([np.broadcast_to(k.stiffness(s), omega.shape) for k in self.links])
        degrees = max(len(numerator) for numerator in self.compliances.values())
        numerators = np.zeros((len(self.compliances), degrees, omega.shape[1]))
        for row, numerator in zip(numerators, self.compliances.values(), strict=True):
            row[: len(numerator)] = numerator
        total, difference = np.empty((2, *omega.shape), complex)
        (denominator,) = self._polynomials()
        add_links(omega, denominator, numerators, stiffness, total, difference)
        return total, difference

    def _points(self, omega: Floats) -> tuple[Complexes, Floats]:
        """Points j omega, shape (L, 1) or (L, B), and omega for every vector, shape (L, B)."""
        omega = np.ascontiguousarray(omega if omega.ndim == 2 else omega[:, None])
        of_each = np.broadcast_to(omega, (len(omega), self.denominator.shape[1]))
        return np.multiply(1j, omega), np.ascontiguousarray(of_each)

    def _polynomials(self, *pairs: tuple[int, int]) -> list[Polynomial]:
        """The denominator and some numerators, as kernels read them."""
        wanted = [self.denominator, *(self.compliances[pair] for pair in pairs)]
        return [np.ascontiguousarray(polynomial) for polynomial in wanted]

    def _add_links(self, s: Complexes) -> tuple[Complexes, Complexes]:
        inverse: Complexes = 1 / evaluate(self.denominator, s)
        h: dict[tuple[int, int], Complexes] = {
            pair: evaluate(numerator, s) * inverse for pair, numerator in self.compliances.items()
        }
        total: Complexes = np.zeros_like(inverse)
        difference: Complexes = np.ones_like(inverse)
        for number, link in enumerate(self.links, start=1):
            stiffness = link.stiffness(s)
            pivot = 1 + stiffness * h[number, number]
            difference *= pivot
            gain = stiffness / pivot
            total -= gain * h[0, number] ** 2
            for i, j in h:
                if j > number and (i == 0 or i > number):
                    first = h[min(i, number), max(i, number)]
                    h[i, j] = h[i, j] - gain * first * h[number, j]
        return total, difference


def remainder_of(
    mechanism: Mechanism, links: tuple[DynamicLink, ...], filters: tuple[Filter, ...]
) -> Remainder:
    """What dynamic links add to a mechanism with filters."""
    pairs = [mechanism.drive, *((link.first, link.second) for link in links)]
    couples = [(i, j) for j in range(1, len(pairs)) for i in range(j + 1)]
    numerators, denominator = compliances(mechanism, [(pairs[i], pairs[j]) for i, j in couples])
    return Remainder(links, dict(zip(couples, numerators, strict=True)), denominator, filters)


def real_pairs(values: Complexes) -> Floats:
    """Real and imaginary parts along a further axis, shape (..., 2)."""
    return values.view(float).reshape(*values.shape, 2)
