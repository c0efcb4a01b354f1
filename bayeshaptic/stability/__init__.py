"""Critical stiffness and the rules beside it."""

from bayeshaptic.stability.binding import BindingCrossing
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.stability.crossings import Crossings, find_crossings
from bayeshaptic.stability.damping import Backward, LowPass
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness, etfe_critical_stiffness
from bayeshaptic.stability.kb_region import KbRegion, kb_region
from bayeshaptic.stability.kb_width import Boundary, ZWidth
from bayeshaptic.stability.relay import RelayMeasurement, measure_relay
from bayeshaptic.stability.relay_check import RelayCheck, check_relay
from bayeshaptic.stability.rules import (
    ground_damping,
    passivity_limit,
    quantisation_limit,
    rigid_limit,
)
from bayeshaptic.stability.spectral_radius import confirms, spectral_radius

__all__ = [
    "Backward",
    "KbRegion",
    "Boundary",
    "LowPass",
    "ZWidth",
    "kb_region",
    "BindingCrossing",
    "CriticalStiffness",
    "Crossings",
    "EtfeCriticalStiffness",
    "RelayCheck",
    "RelayMeasurement",
    "check_relay",
    "confirms",
    "critical_stiffness",
    "etfe_critical_stiffness",
    "find_crossings",
    "ground_damping",
    "measure_relay",
    "passivity_limit",
    "quantisation_limit",
    "rigid_limit",
    "spectral_radius",
]
