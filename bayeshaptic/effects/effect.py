"""What an effect is: a physical phenomenon that the base model lacks.

Every effect is one small frozen dataclass with a name, a title, a family, and its parameters with
priors; the families differ in what it does with them:

linear
    `LinearEffect.apply` extends the mechanism or the loop.
nonlinear
    `NonlinearEffect` adds an internal force built from the motion; the loop's large-amplitude
    limit is that of the linear rest.
time-varying
    parameters that differ between parts of the recording.
measurement
    the data or the noise change, the device does not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from bayeshaptic.effects.unseen import Unseen
from bayeshaptic.models import LinearSystem, Model, Parameter
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class LinearEffect(ABC):
    """An effect that extends the linear model.

    Attributes
    ----------
    parameters : tuple of Parameter
        With priors, in the units of the model it was made for.
    """

    parameters: tuple[Parameter, ...]

    name: ClassVar[str]
    title: ClassVar[str]
    family: ClassVar[str] = "linear"
    ties: ClassVar[tuple[str, ...]] = ()
    """Effects that one recording may not tell from this one."""
    told_apart_by: ClassVar[str] = ""
    """The measurement that would separate the ties, in words."""
    several: ClassVar[bool] = False
    """Whether a device may have more than one of it."""
    belongs_to: ClassVar[str] = "device"
    """Where it is the same one: "device", "configuration", or "" for that of one hand alone."""

    @classmethod
    @abstractmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        """Its variants that make sense on `model`, with priors; none where it makes no sense."""

    @abstractmethod
    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        """Where a fit should start, natural values, shape (S, number of parameters)."""

    @abstractmethod
    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        """The system with the effect; `values` holds every parameter of the model, shape (B,)."""

    def unseen(self, model: Model, etfe: Etfe) -> Unseen | None:
        """What it may be on `model` where nobody has seen it; None where that is not asked."""
        return None

    def on_the_other_side(
        self, model: Model, etfe: Etfe, own: Floats
    ) -> tuple[LinearEffect, Floats] | None:
        """The effect that does the same to the response on the other side of the masses.

        With its values; None where there is none.  Forces that act on the masses tell them apart.

        Parameters
        ----------
        model : Model
            Without this effect.
        etfe : Etfe
        own : ndarray
            Values of this effect's parameters.
        """
        return None

    def own(self, values: Mapping[str, Floats]) -> tuple[Floats, ...]:
        """The values of this effect's parameters, in their order, shape (B,) each."""
        return tuple(values[parameter.name] for parameter in self.parameters)
