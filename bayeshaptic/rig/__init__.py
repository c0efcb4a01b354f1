"""The virtual bench: a time-domain simulation of device, hand, loop and encoder.

It shares no code with the models that are fitted to its recordings: it is the independent check
on them.
"""

from bayeshaptic.rig.bench import Bench
from bayeshaptic.rig.effects import REGISTRY, Effect, register
from bayeshaptic.rig.excitation import Multisine, WhiteNoise
from bayeshaptic.rig.loops import WallRun, run_loop, run_relay, run_wall
from bayeshaptic.rig.recording import SimulatedRecording, write_recording
from bayeshaptic.rig.simulate import simulate
from bayeshaptic.rig.truth import TrueLimit, critical_limit, spectral_radius

__all__ = [
    "REGISTRY",
    "Bench",
    "Effect",
    "Multisine",
    "SimulatedRecording",
    "TrueLimit",
    "WallRun",
    "WhiteNoise",
    "critical_limit",
    "register",
    "run_loop",
    "run_relay",
    "run_wall",
    "simulate",
    "spectral_radius",
    "write_recording",
]
