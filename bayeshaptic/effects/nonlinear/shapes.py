"""Forces as functions of one variable of the motion, for a strength of one.

A law's own file says which shapes stand for it: the residual's tests look for them, harmonic
balance and inverse dynamics fit them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.models.parameter import unit_of
from bayeshaptic.types import Floats

VELOCITY, POSITION, STRETCH, COMMAND = "velocity", "position", "stretch", "command"
LOAD_VELOCITY = "load velocity"
STRETCH_VELOCITY = "stretch velocity"  # of the motor relative to the load
ALONG = "damping along the way"  # a function of the position, times the velocity
EXCESS_NOISE = "excess noise"  # a test that is of no shape


@dataclass(frozen=True)
class Shape:
    """A force of strength one.

    Attributes
    ----------
    name : str
        As tests call it, "sign(v)", or terms of the inverse dynamics.
    title : str
        In words; "{where}" stands for the place.
    over : str
        The variable: "velocity" or "position" of the motor, "load velocity", "stretch" of the
        connection or "stretch velocity", or "command"; or "damping along the way", where `force`
        takes the motor's position and its result is multiplied by the velocity.
    force : callable
        From the variable to the force on the mass, shapes (N,).
    dimension : str
        Of the strength: one that `unit_of` knows, or a unit with {force} and {x}.
    positive : bool
        Whether a negative strength makes no sense.
    jumps : bool
        Whether it does where the variable changes sign.
    """

    name: str
    title: str
    over: str
    force: Callable[[Floats], Floats] = field(repr=False)
    dimension: str = "force"
    positive: bool = False
    jumps: bool = False

    def unit(self, force: str, x: str) -> str:
        """Of the strength, from the units of force and position."""
        if "{" in self.dimension:
            return self.dimension.format(force=force, x=x)
        return unit_of(self.dimension, force, x)


@dataclass(frozen=True)
class Usual:
    """Root mean squares of a motion, and the unit of its position: what shapes are sized by."""

    velocity: float
    position: float
    x: str

    @classmethod
    def of(cls, velocity: Floats, position: Floats, x: str) -> Usual:
        return cls(float(np.sqrt(np.mean(velocity**2))), float(np.sqrt(np.mean(position**2))), x)
