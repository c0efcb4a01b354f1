"""Imports every effect of this package, so that it is registered."""

from bayeshaptic.effects import measurement
from bayeshaptic.effects.linear import (
    attached_mass,
    base_compliance,
    centring_stiffness,
    extra_delay,
    low_pass,
    reflex,
    transmission_loss,
)
from bayeshaptic.effects.nonlinear import actuator, friction, springs

__all__ = [
    "actuator",
    "attached_mass",
    "base_compliance",
    "centring_stiffness",
    "extra_delay",
    "friction",
    "low_pass",
    "measurement",
    "reflex",
    "springs",
    "transmission_loss",
]
