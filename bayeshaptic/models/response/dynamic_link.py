"""Linear forces between masses that no spring and damper make: delayed, hysteretic, relaxing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.numerics.polynomials.polynomial import Polynomial
from bayeshaptic.types import Complexes, Floats

Index = slice | NDArray[np.bool_] | NDArray[np.int_]


@dataclass(frozen=True)
class DynamicLink:
    """A force between two masses, or a mass and the ground (None), by its dynamic stiffness.

    Attributes
    ----------
    first, second : int, int or None
    law : callable
        ``law(s, *values)``: force over stretch at points `s`, which broadcast with the values
        (their axis last).  It must be analytic to the right of the imaginary axis, real on the
        positive real axis, and grow more slowly than s^2.
    values : tuple of ndarray, each of shape (B,)
    ratio : tuple of two ndarray, each of shape (degree + 1, B), or None
        Numerator and denominator of the law, where it is a ratio of polynomials: with such a link
        alone a response has finitely many poles still.
    """

    first: int
    second: int | None
    law: Callable[..., Complexes]
    values: tuple[Floats, ...]
    ratio: tuple[Polynomial, Polynomial] | None = None

    def stiffness(self, s: Complexes) -> Complexes:
        """Force over stretch, shape (..., B)."""
        return self.law(s, *self.values)

    def rows(self, index: Index) -> DynamicLink:
        """A part of the batch."""
        ratio = self.ratio
        if ratio is not None:
            ratio = ratio[0][:, index], ratio[1][:, index]
        return replace(self, values=tuple(value[index] for value in self.values), ratio=ratio)
