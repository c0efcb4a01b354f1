"""Rational factors in the loop: actuators, sensors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.models.response.dynamic_link import Index
from bayeshaptic.numerics.polynomials.polynomial import Polynomial, evaluate, multiply
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class Filter:
    """A rational factor in the loop: actuator, sensor.  Polynomials of shape (degree + 1, B).

    Attributes
    ----------
    numerator, denominator : ndarray
    of_position : bool
        Whether it is behind the masses, in what senses the position: forces on the masses go
        through it, and know of a motion that it has not yet filtered.
    """

    numerator: Polynomial
    denominator: Polynomial
    of_position: bool = False

    def rows(self, index: Index) -> Filter:
        """A part of the batch."""
        return Filter(self.numerator[:, index], self.denominator[:, index], self.of_position)


Filters = tuple[Filter, ...]


def filtered(
    numerator: Polynomial, denominator: Polynomial, filters: Filters
) -> tuple[Polynomial, Polynomial]:
    """Numerator and denominator of a transfer function behind filters."""
    for factor in filters:
        numerator = multiply(numerator, factor.numerator)
        denominator = multiply(denominator, factor.denominator)
    return numerator, denominator


def share(filters: Filters, s: Complexes) -> Complexes:
    """What filters of one vector let through at points s of shape (L,); shape (L,)."""
    through = np.ones(len(s), complex)
    for factor in filters:
        points = s[:, None]
        through *= (evaluate(factor.numerator, points) / evaluate(factor.denominator, points))[:, 0]
    return through


def in_time(filters: Filters, motion: Floats, period_s: float) -> Floats:
    """Sampled motions, shape (..., N), behind filters of one vector, from rest.

    Exact for motions that go straight from one sample to the next.
    """
    from scipy.signal import cont2discrete, lfilter

    for factor in filters:
        top, bottom = factor.numerator[::-1, 0], factor.denominator[::-1, 0]
        numerator, denominator, _ = cont2discrete((top, bottom), period_s, method="foh")
        motion = lfilter(np.ravel(numerator), denominator, motion, axis=-1)
    return motion
