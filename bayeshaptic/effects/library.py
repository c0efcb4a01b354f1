"""Imports every effect of this package, so that it is registered."""

from bayeshaptic.effects import (
    actuator,
    attached_mass,
    base_compliance,
    centring_stiffness,
    extra_delay,
    friction,
    low_pass,
    measurement,
    reflex,
    springs,
    transmission_loss,
)

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
