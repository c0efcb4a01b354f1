"""A filter in the loop."""

from __future__ import annotations

from dataclasses import dataclass

from bayeshaptic.models.response.dynamic_link import Index
from bayeshaptic.numerics.polynomial import Polynomial


@dataclass(frozen=True)
class Filter:
    """A rational factor in the loop: actuator, sensor.  Polynomials of shape (degree + 1, B)."""

    numerator: Polynomial
    denominator: Polynomial

    def rows(self, index: Index) -> Filter:
        """A part of the batch."""
        return Filter(self.numerator[:, index], self.denominator[:, index])
