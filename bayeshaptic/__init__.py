"""How stiff a virtual wall may be on a haptic device, and how sure of it one can be.

The names below are the public interface; each is imported from its module on first use, so that
``import bayeshaptic`` and the command line's help cost nothing::

    import bayeshaptic as bh

    recording = bh.read_recording("lhifam-user.csv")
    etfe = bh.estimate_etfe(recording)
    model = bh.grasped(device="lhifam")
    fit = bh.least_squares(model, etfe)
    posterior = bh.sample(model, etfe, start=fit)
    limit = bh.critical_stiffness(posterior)
    limit.safe(0.01)  # the stiffness with one per cent probability of instability
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bayeshaptic.devices import Device, device_names, load_device
    from bayeshaptic.diagnosis.analysis import Analysis, analyse
    from bayeshaptic.diagnosis.closed import Closed, close_loop
    from bayeshaptic.errors import BayeshapticWarning, InputError, Notice
    from bayeshaptic.inference.arviz_io import load_posterior
    from bayeshaptic.inference.choose import Choice, choose_model
    from bayeshaptic.inference.least_squares import Fit, least_squares
    from bayeshaptic.inference.next_experiment import Experiment, next_experiment
    from bayeshaptic.inference.population.infer import Population, infer_population
    from bayeshaptic.inference.posterior import Posterior
    from bayeshaptic.inference.sampler import sample
    from bayeshaptic.models import (
        HalfNormal,
        LogNormal,
        LogUniform,
        Model,
        NearZero,
        Normal,
        Uniform,
        free,
        grasped,
        rigid,
    )
    from bayeshaptic.recordings import (
        Recording,
        Study,
        read_frf,
        read_measurement,
        read_recording,
        read_study,
        recording_from_arrays,
    )
    from bayeshaptic.recordings.response.etfe import Etfe, estimate_etfe
    from bayeshaptic.report import write_report
    from bayeshaptic.report.study.write import write_study_report
    from bayeshaptic.stability import (
        Backward,
        Case,
        CriticalStiffness,
        KbRegion,
        LowPass,
        RelayMeasurement,
        critical_stiffness,
        device_limit,
        measure_relay,
    )
    from bayeshaptic.stability.guidance.elasticities import Elasticities, elasticities
    from bayeshaptic.stability.guidance.shares import VarianceShares, variance_shares
    from bayeshaptic.stability.guidance.sweep import Sweep, sweep
    from bayeshaptic.stability.walls.limit_table import LimitTable, limit_table
    from bayeshaptic.stability.walls.region import kb_region
    from bayeshaptic.study.analysis import StudyAnalysis, analyse_study

__version__ = "0.1.0"

# Where each name lives: the same imports as above, done on first use (PEP 562).
_HOMES = {
    "bayeshaptic.devices": ("Device", "device_names", "load_device"),
    "bayeshaptic.diagnosis.analysis": ("Analysis", "analyse"),
    "bayeshaptic.diagnosis.closed": ("Closed", "close_loop"),
    "bayeshaptic.study.analysis": ("StudyAnalysis", "analyse_study"),
    "bayeshaptic.errors": ("BayeshapticWarning", "InputError", "Notice"),
    "bayeshaptic.inference": ("Fit", "Posterior", "least_squares", "load_posterior", "sample"),
    "bayeshaptic.inference.choose": ("Choice", "choose_model"),
    "bayeshaptic.inference.population.infer": ("Population", "infer_population"),
    "bayeshaptic.models": (
        "HalfNormal",
        "LogNormal",
        "LogUniform",
        "NearZero",
        "Model",
        "Normal",
        "Uniform",
        "free",
        "grasped",
        "rigid",
    ),
    "bayeshaptic.recordings": (
        "Recording",
        "Study",
        "read_frf",
        "read_measurement",
        "read_recording",
        "read_study",
        "recording_from_arrays",
    ),
    "bayeshaptic.recordings.response.etfe": ("Etfe", "estimate_etfe"),
    "bayeshaptic.report": ("write_report",),
    "bayeshaptic.report.study.write": ("write_study_report",),
    "bayeshaptic.stability": (
        "Backward",
        "Case",
        "CriticalStiffness",
        "Elasticities",
        "KbRegion",
        "LimitTable",
        "LowPass",
        "RelayMeasurement",
        "Sweep",
        "VarianceShares",
        "critical_stiffness",
        "device_limit",
        "elasticities",
        "kb_region",
        "limit_table",
        "measure_relay",
        "sweep",
        "variance_shares",
    ),
    "bayeshaptic.inference.next_experiment": (
        "Experiment",
        "next_experiment",
    ),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Analysis",
    "Backward",
    "BayeshapticWarning",
    "Case",
    "Choice",
    "Closed",
    "CriticalStiffness",
    "Device",
    "Elasticities",
    "Etfe",
    "Experiment",
    "Fit",
    "HalfNormal",
    "InputError",
    "KbRegion",
    "LimitTable",
    "LogNormal",
    "LogUniform",
    "LowPass",
    "Model",
    "NearZero",
    "Normal",
    "Notice",
    "Population",
    "Posterior",
    "Recording",
    "RelayMeasurement",
    "Study",
    "StudyAnalysis",
    "Sweep",
    "Uniform",
    "VarianceShares",
    "analyse",
    "analyse_study",
    "choose_model",
    "close_loop",
    "critical_stiffness",
    "device_limit",
    "device_names",
    "elasticities",
    "estimate_etfe",
    "free",
    "grasped",
    "infer_population",
    "kb_region",
    "least_squares",
    "limit_table",
    "load_device",
    "load_posterior",
    "measure_relay",
    "next_experiment",
    "read_frf",
    "read_measurement",
    "read_recording",
    "read_study",
    "recording_from_arrays",
    "rigid",
    "sample",
    "sweep",
    "variance_shares",
    "write_report",
    "write_study_report",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'bayeshaptic' has no attribute {name!r}")
    value = getattr(importlib.import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
