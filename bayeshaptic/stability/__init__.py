"""Critical stiffness and the rules beside it."""

from bayeshaptic.stability.binding import BindingCrossing
from bayeshaptic.stability.cases import Case, DeviceLimit, device_limit
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.stability.crossings import Crossings, find_crossings
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness, etfe_critical_stiffness
from bayeshaptic.stability.guidance.elasticities import Elasticities, elasticities
from bayeshaptic.stability.guidance.shares import Share, VarianceShares, variance_shares
from bayeshaptic.stability.guidance.sweep import Jump, Sweep, sweep
from bayeshaptic.stability.relay.check import RelayCheck, check_relay
from bayeshaptic.stability.relay.measure import measure_relay
from bayeshaptic.stability.relay.measurement import RelayMeasurement
from bayeshaptic.stability.rules import (
    ground_damping,
    passivity_limit,
    quantisation_limit,
    rigid_limit,
)
from bayeshaptic.stability.spectral_radius import confirms, spectral_radius
from bayeshaptic.stability.walls.damping import Backward, LowPass
from bayeshaptic.stability.walls.limit_table import LimitTable, limit_table
from bayeshaptic.stability.walls.region import KbRegion, kb_region
from bayeshaptic.stability.walls.width import Boundary, ZWidth

__all__ = [
    "Backward",
    "BindingCrossing",
    "Boundary",
    "Case",
    "CriticalStiffness",
    "Crossings",
    "DeviceLimit",
    "Elasticities",
    "EtfeCriticalStiffness",
    "Jump",
    "KbRegion",
    "LimitTable",
    "LowPass",
    "RelayCheck",
    "RelayMeasurement",
    "Share",
    "Sweep",
    "VarianceShares",
    "ZWidth",
    "check_relay",
    "confirms",
    "critical_stiffness",
    "device_limit",
    "elasticities",
    "etfe_critical_stiffness",
    "find_crossings",
    "ground_damping",
    "kb_region",
    "limit_table",
    "measure_relay",
    "passivity_limit",
    "quantisation_limit",
    "rigid_limit",
    "spectral_radius",
    "sweep",
    "variance_shares",
]
