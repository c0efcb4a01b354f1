"""What an effect may be where nobody has seen it: its shapes, and how large it could be at all."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Unseen:
    """An effect of any strength: what it could look like.

    Attributes
    ----------
    dimension, title : str
        Of the strength, see `unit_of`; zero is no effect.
    largest : float
        Of the strength; a device with more is another device.
    own : callable
        From strengths (C,) and shapes (C, K) to the values of the effect's parameters, (C, p).
    shapes : ndarray, shape (S, K)
        Everything else that is not known of it: a mode's frequency and damping.
    weight : ndarray, shape (S,)
        Probability of each shape.
    lowest : float
        Least strength, below zero where it may have either sign.
    unit_size : float
        What a strength of one is, in a unit that all recordings of a device share.
    """

    dimension: str
    title: str
    largest: float
    own: Callable[[Floats, Floats], Floats] = field(repr=False)
    shapes: Floats = field(default_factory=lambda: np.zeros((1, 0)), repr=False)
    weight: Floats = field(default_factory=lambda: np.ones(1), repr=False)
    lowest: float = 0.0
    unit_size: float = 1.0


def alone(strength: Floats, shapes: Floats) -> Floats:
    """Parameters, (N, 1), of an effect whose one parameter is its strength, (N,)."""
    return strength[:, None]


def combined(*axes: ArrayLike) -> tuple[Floats, Floats]:
    """Every combination of values on the axes, (S, axes), with probabilities (S,), all alike."""
    values = [np.asarray(axis, float) for axis in axes]
    table = np.stack([a.ravel() for a in np.meshgrid(*values, indexing="ij")], axis=1)
    return table, np.full(len(table), math.prod(1 / len(axis) for axis in values))
