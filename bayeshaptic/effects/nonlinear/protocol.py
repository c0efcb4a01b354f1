"""The protocol of nonlinear effects: an internal force, or an actuator that is not linear."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

from bayeshaptic.effects.nonlinear.internal_force import MOTOR, Law, Place
from bayeshaptic.effects.nonlinear.shapes import Shape, Usual
from bayeshaptic.models import Model
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Motion:
    """The motion at a place without the force, to choose the sizes of shapes by.

    Attributes
    ----------
    position, velocity : ndarray
    command : ndarray
        The commanded force.
    """

    position: Floats
    velocity: Floats
    command: Floats


@dataclass(frozen=True)
class NonlinearEffect(ABC):
    """An internal force: strength times a function of position and velocity at a place.

    Attributes
    ----------
    place : Place
    shape : mapping
        Parameters of the function other than the strength: name to value.
    """

    place: Place = MOTOR
    shape: Mapping[str, float] = field(default_factory=dict)

    name: ClassVar[str]
    title: ClassVar[str]
    family: ClassVar[str] = "nonlinear"
    tests: ClassVar[tuple[Shape, ...]] = ()
    """Forces that the residual is tested for, of the variable over its rms."""
    over: ClassVar[tuple[str, ...]]
    """Variables of the tests that call for it, and names of tests that are of no shape."""
    strength: ClassVar[tuple[str, str]]
    """Name and dimension of the strength."""
    dimensions: ClassVar[Mapping[str, str]] = {}
    """Dimensions of the shape's parameters."""
    signed: ClassVar[bool] = False
    """Whether the strength may be negative."""
    tuned: ClassVar[tuple[str, ...]] = ()
    """The shape's parameters that are fitted from the grid on; all above zero."""
    most: ClassVar[Mapping[str, float]] = {}
    """The largest values of those that have one."""
    plain: ClassVar[Mapping[str, float]] = {}
    """The shape's values with which it is the simplest law of its strength, if it contains that."""
    ties: ClassVar[tuple[str, ...]] = ()
    told_apart_by: ClassVar[str] = ""
    sticks: ClassVar[bool] = False
    """Whether it may hold a mass still, against whatever else acts in the same step."""

    @classmethod
    def candidates(
        cls, model: Model, motion: Mapping[Place, Motion]
    ) -> tuple[NonlinearEffect, ...]:
        """Its variants: places, and a grid of shapes sized by the motion."""
        return (cls(),)

    @classmethod
    def shapes(cls, place: Place, usual: Usual) -> tuple[Shape, ...]:
        """Its force where it is a function of the motion alone, to fit linearly; none if not."""
        return ()

    @classmethod
    def corrections(cls, usual: Usual) -> tuple[Shape, ...]:
        """What it adds to a simpler law of the same thing, at the motor."""
        return ()

    def called_for(self, raised: set[str]) -> bool:
        """Whether one of the raised variables or tests is this effect's."""
        return bool(raised & set(self.over))

    @property
    def grounded(self) -> bool:
        """Whether it acts between a mass and the ground, and so in the motion that a hand makes."""
        return self.place.second is None

    def contains(self, other: NonlinearEffect) -> bool:
        """Whether another is the simplest law of its strength, and it is that with some shape."""
        return bool(self.plain) and not other.shape and other.strength == self.strength

    def departing(self, part: float) -> Self:
        """The law that is this part of the way from the simplest one to this."""
        between = {name: at + part * (self.shape[name] - at) for name, at in self.plain.items()}
        return replace(self, shape={**self.shape, **between})

    @abstractmethod
    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        """The force for a given strength."""

    @abstractmethod
    def first_strengths(self, model: Model, theta: Floats, motion: Motion) -> Floats:
        """Strengths to begin a search with, from faint to strong, shape (S,)."""


@dataclass(frozen=True)
class Acting:
    """A force as it acts.

    Attributes
    ----------
    effect : NonlinearEffect
    strength : float
    """

    effect: NonlinearEffect
    strength: float

    @property
    def moves_a_mass(self) -> bool:
        """An actuator's does not: it takes some of the command away."""
        return not isinstance(self.effect, CommandEffect)


@dataclass(frozen=True)
class CommandEffect(NonlinearEffect):
    """An actuator whose force is not proportional to the command.

    It adds no force to the mechanism: it takes some of the commanded one away.
    """

    @property
    def grounded(self) -> bool:
        """It acts on the command alone."""
        return False

    @abstractmethod
    def lost(self, strength: float, command: Floats) -> Floats:
        """What of the command does not arrive, shape (N,)."""

    def law(self, strength: float, model: Model, theta: Floats) -> Law:
        raise NotImplementedError("acts on the command, not on the motion")
