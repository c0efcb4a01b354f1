"""Imports every effect of this package, so that it is registered."""

from bayeshaptic.effects import extra_delay, friction, springs

__all__ = ["extra_delay", "friction", "springs"]
