"""Sizes of a device, for the priors and starting values of effects."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.models import Model, Parameter
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.start import informed
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

MOTOR, BODY, HAND = "m1", "m2", "mh"
MASSES = {MOTOR: 0, BODY: 1}
"""Masses of a device by name: where they stand in every mechanism."""


def place_of(name: str, mechanism: Mechanism) -> int:
    """Where the mass called `name` stands in a mechanism; the hand comes after the device."""
    if name != HAND:
        return MASSES[name]
    assert mechanism.hand is not None
    return mechanism.hand


def device_mass(model: Model, theta: Floats) -> float:
    """Mass of a device without a hand, as its model with the values `theta`, shape (P,), has it."""
    values = dict(zip(model.names, theta, strict=True))
    return float(values.get("m", values.get("m1", 0.0) + values.get("m2", 0.0)))


@dataclass(frozen=True)
class Typical:
    """Prior medians of a model's parameters, and what of the measurement sets a scale.

    Attributes
    ----------
    values : mapping
        Name to median; the one mass of a rigid model is called m1 here.
    low_hz, high_hz : float
        The band.
    period_s : float
    """

    values: Mapping[str, float]
    low_hz: float
    high_hz: float
    period_s: float

    def __getitem__(self, name: str) -> float:
        return self.values[name]

    def __contains__(self, name: str) -> bool:
        return name in self.values

    @property
    def device_mass(self) -> float:
        """Everything that moves with the motor, without the hand."""
        return sum(self.values[name] for name in (MOTOR, BODY) if name in self.values)

    def frequencies(self, count: int) -> Floats:
        """Equal steps of log frequency over the band, without its ends."""
        return np.geomspace(self.low_hz, self.high_hz, count + 2)[1:-1]


def typical(model: Model, etfe: Etfe) -> Typical:
    """The sizes of `model`: of its device file, else of the data."""
    model = informed(model, etfe)
    values = {name: float(model.prior(name).quantile(0.5)) for name in model.names}
    values |= model.fixed
    if "m" in values:
        values[MOTOR] = values.pop("m")
    low, high = etfe.band_hz
    return Typical(values, low, high, etfe.period_s)


def grid(*axes: ArrayLike) -> Floats:
    """Every combination of the values on the axes, shape (product of lengths, axes)."""
    return np.stack([axis.ravel() for axis in np.meshgrid(*axes, indexing="ij")], axis=1)


def apart(model: Model, parameters: tuple[Parameter, ...]) -> tuple[Parameter, ...]:
    """The parameters, numbered where the model has some of these names already."""
    number = 1
    while any(_numbered(p.name, number) in model.names for p in parameters):
        number += 1
    return tuple(replace(p, name=_numbered(p.name, number)) for p in parameters)


def _numbered(name: str, number: int) -> str:
    return name if number == 1 else f"{name}_{number}"
