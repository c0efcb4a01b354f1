"""Effects that can be added to a bench: importing this package registers them all."""

from bayeshaptic.rig.effects.command import ActuatorSaturation, Bump, GainDrift, LostCommand
from bayeshaptic.rig.effects.dynamics import (
    ActuatorLag,
    BaseCompliance,
    CentringStiffness,
    ExtraDelay,
    PositionFilter,
    SecondMode,
    StructuralDamping,
)
from bayeshaptic.rig.effects.effect import REGISTRY, Effect, MotionScales, make_effect, register
from bayeshaptic.rig.effects.friction import CoulombFriction, DahlFriction, StribeckFriction
from bayeshaptic.rig.effects.hand import GripDrift, Reflex
from bayeshaptic.rig.effects.nonlinear import (
    Backlash,
    ConstantForce,
    Drag,
    ForceRipple,
    Gravity,
    HardeningConnection,
    HardeningSpring,
)
from bayeshaptic.rig.effects.sensor import (
    DroppedSamples,
    HeldSamples,
    MainsTone,
    PositionClipping,
    Quantisation,
    SampleJitter,
)

__all__ = [
    "REGISTRY",
    "ActuatorLag",
    "ActuatorSaturation",
    "Backlash",
    "BaseCompliance",
    "Bump",
    "CentringStiffness",
    "ConstantForce",
    "CoulombFriction",
    "DahlFriction",
    "Drag",
    "DroppedSamples",
    "Effect",
    "ExtraDelay",
    "ForceRipple",
    "GainDrift",
    "Gravity",
    "GripDrift",
    "HardeningConnection",
    "HardeningSpring",
    "HeldSamples",
    "LostCommand",
    "MainsTone",
    "PositionClipping",
    "PositionFilter",
    "Quantisation",
    "Reflex",
    "SampleJitter",
    "MotionScales",
    "SecondMode",
    "StribeckFriction",
    "StructuralDamping",
    "make_effect",
    "register",
]
