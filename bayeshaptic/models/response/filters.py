"""Rational factors in the loop: actuators, sensors."""

from __future__ import annotations

from dataclasses import dataclass

from bayeshaptic.models.response.dynamic_link import Index
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, multiply


@dataclass(frozen=True)
class Filter:
    """A rational factor in the loop: actuator, sensor.  Polynomials of shape (degree + 1, B)."""

    numerator: Polynomial
    denominator: Polynomial

    def rows(self, index: Index) -> Filter:
        """A part of the batch."""
        return Filter(self.numerator[:, index], self.denominator[:, index])


Filters = tuple[Filter, ...]


def filtered(
    numerator: Polynomial, denominator: Polynomial, filters: Filters
) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of a transfer function behind filters."""
    for factor in filters:
        numerator = multiply(numerator, factor.numerator)
        denominator = multiply(denominator, factor.denominator)
    return numerator, denominator
