"""Rational factors in the loop."""

from __future__ import annotations

from bayeshaptic.models.response.filter import Filter
from bayeshaptic.numerics.polynomial import Polynomial, multiply

Filters = tuple[Filter, ...]


def filtered(
    numerator: Polynomial, denominator: Polynomial, filters: Filters
) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of a transfer function behind filters."""
    for factor in filters:
        numerator = multiply(numerator, factor.numerator)
        denominator = multiply(denominator, factor.denominator)
    return numerator, denominator
