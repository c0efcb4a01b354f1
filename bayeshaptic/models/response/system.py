"""Everything between the commanded force and the sampled position, for a batch of vectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.models.response.aliases import sampled_remainder
from bayeshaptic.models.response.dynamic_link import DynamicLink, Index
from bayeshaptic.models.response.filters import Filter, filtered
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.poles import poles_and_residues
from bayeshaptic.models.response.rational import RationalArrays, rational_form, sampled_response
from bayeshaptic.models.response.remainder import Remainder, remainder_of
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, evaluate
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class LinearSystem:
    """Mechanism, loop delay and filters of a batch of parameter vectors.

    Attributes
    ----------
    mechanism : Mechanism
    delay_s : ndarray, shape (B,)
    filters : tuple of Filter
        Rational factors before or after the mechanism (they commute, but for forces inside it).
    dynamic_links : tuple of DynamicLink
        Further forces inside the mechanism, not rational in s.
    """

    mechanism: Mechanism
    delay_s: Floats
    filters: tuple[Filter, ...] = ()
    dynamic_links: tuple[DynamicLink, ...] = ()

    @property
    def batch(self) -> int:
        return self.mechanism.batch

    @property
    def rational(self) -> bool:
        """Whether mechanism and filters are all there is: finitely many poles."""
        return not self.dynamic_links

    @property
    def has_rational_form(self) -> bool:
        """Whether `rational_form` is all there is: a single link may be a ratio of polynomials."""
        return self.rational or (
            len(self.dynamic_links) == 1 and self.dynamic_links[0].ratio is not None
        )

    @property
    def rational_part(self) -> LinearSystem:
        """The same without its dynamic links."""
        return replace(self, dynamic_links=()) if self.dynamic_links else self

    @property
    def remainder(self) -> Remainder:
        """What the dynamic links add to the rational part."""
        return remainder_of(self.mechanism, self.dynamic_links, self.filters)

    @property
    def of_masses(self) -> LinearSystem:
        """From the command to how the masses move: without what filters the position."""
        return self._with(tuple(f for f in self.filters if not f.of_position))

    @property
    def of_forces(self) -> LinearSystem:
        """From a force at the motor to the position that is read: without the actuator's filters.

        The command's delay is not left out here.
        """
        return self._with(self.sensing)

    @property
    def sensing(self) -> tuple[Filter, ...]:
        """The filters of the position."""
        return tuple(factor for factor in self.filters if factor.of_position)

    def _with(self, filters: tuple[Filter, ...]) -> LinearSystem:
        return self if len(filters) == len(self.filters) else replace(self, filters=filters)

    def with_filter(
        self, numerator: Polynomial, denominator: Polynomial, of_position: bool = False
    ) -> LinearSystem:
        factor = Filter(numerator, denominator, of_position)
        return replace(self, filters=(*self.filters, factor))

    def with_dynamic_link(self, link: DynamicLink) -> LinearSystem:
        return replace(self, dynamic_links=(*self.dynamic_links, link))

    def rows(self, index: Index) -> LinearSystem:
        """A part of the batch."""
        return replace(
            self,
            mechanism=self.mechanism.rows(index),
            delay_s=self.delay_s[index],
            filters=tuple(factor.rows(index) for factor in self.filters),
            dynamic_links=tuple(link.rows(index) for link in self.dynamic_links),
        )

    def transfer(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of the rational part, continuous, without the delay."""
        return filtered(*self.mechanism.transfer(), self.filters)

    def poles(self) -> tuple[Complexes, Complexes]:
        """Poles and residues of the rational part without the delay, each of shape (B, n).

        Poles that coincide are moved apart, but for two at zero: their residues blow up
        (`sampled_response` does not use them there).
        """
        return poles_and_residues(self.mechanism, self.filters)

    def continuous_response(self, s: Complexes) -> Complexes:
        """P(s) without hold and delay at points `s` of shape (L,); shape (B, L)."""
        numerator, denominator = self.transfer()
        points = np.asarray(s, complex)[:, None]
        response = evaluate(numerator, points) / evaluate(denominator, points)
        if self.dynamic_links:
            response = response + self.remainder.at(points)
        return np.asarray(response.T)

    def response(self, frequency_hz: Floats, period_s: float, exact: bool) -> Complexes:
        """The sampled response, or its stand-in, and at zero the compliance; shape (B, L)."""
        still = frequency_hz == 0  # where a free device has a pole
        moving = np.where(still, 1.0, frequency_hz)
        way = self.sampled_response if exact else self.continuous_approximation
        response = way(moving, period_s)
        if np.any(still):
            response[:, still] = self._compliance()[:, None]
        return response

    def _compliance(self) -> Floats:
        """Position over a constant force, shape (B,): infinite where nothing holds the device."""
        with np.errstate(divide="ignore", invalid="ignore"):
            response = self.continuous_response(np.zeros(1, complex))[:, 0].real
        return np.where(np.isfinite(response), response, np.inf)

    def continuous_approximation(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """P(s) e^{-s (td + T/2)}, the paper's stand-in for the sampled response; shape (B, L)."""
        s = 2j * np.pi * np.asarray(frequency_hz, float)
        return self.continuous_response(s) * np.exp(-s * (self.delay_s[:, None] + period_s / 2))

    def sampled_response(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """The exact sampled response at frequencies of shape (L,); shape (B, L)."""
        frequency_hz = np.asarray(frequency_hz, float)
        response = sampled_response(self.rational_form(frequency_hz, period_s))
        if self.dynamic_links and not self.has_rational_form:
            remainder = self.remainder
            chunk = 64  # vectors at a time: the arrays of one chunk stay in the cache
            for start in range(0, self.batch, chunk):
                rows = slice(start, start + chunk)
                response[rows] += sampled_remainder(
                    remainder.rows(rows), self.delay_s[rows], frequency_hz, period_s
                )
        return response

    def rational_form(self, frequency_hz: Floats, period_s: float) -> RationalArrays:
        """The rational part, ready to be evaluated at frequencies of shape (L,).

        With a link that is a ratio of polynomials.
        """
        link = self.dynamic_links[0] if self.dynamic_links and self.has_rational_form else None
        return rational_form(
            self.mechanism, self.filters, self.delay_s, frequency_hz, period_s, link
        )
