"""The jobs that are measured, by this version of the package or by an older one."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

import bayeshaptic as bh
from bayeshaptic.rig import Bench, WhiteNoise, simulate

DATA = Path(__file__).resolve().parents[2] / "data" / "recordings"
CASES = ("rigid", "free", "grasped")
DRAWS = 10_000
STARTS = 40
SUBSTEPS = 8


def cpu(job: Callable[[], object], rounds: int) -> float:
    """The least CPU seconds of a call, of calls that fill 50 ms; 0 rounds: of a single call."""
    began = time.process_time()
    job()
    once = time.process_time() - began
    if rounds == 0:
        return once
    began = time.process_time()
    job()
    calls = 1 + int(0.05 / max(time.process_time() - began, 1e-4))
    least = np.inf
    for _ in range(rounds):
        began = time.process_time()
        for _ in range(calls):
            job()
        least = min(least, (time.process_time() - began) / calls)
    return least


def moved(*names: str) -> Any:
    """The first module of these that there is: rooms have been moved since."""
    for name in names:
        try:
            return importlib.import_module(f"bayeshaptic.{name}")
        except ModuleNotFoundError:
            continue
    raise ModuleNotFoundError(names[0])


@lru_cache(maxsize=8)
def fitted(structure: str) -> bh.Fit:
    name = "lhifam-user" if structure == "grasped" else "lhifam-free"
    etfe = bh.estimate_etfe(bh.read_recording(DATA / f"{name}.csv.gz"))
    return bh.least_squares(getattr(bh, structure)(device="lhifam"), etfe)


def loops(structure: str, count: int) -> tuple[bh.Fit, np.ndarray]:
    """A fit, and parameter vectors around it as a posterior has them, but wider."""
    fit = fitted(structure)
    rng = np.random.default_rng(0)
    return fit, fit.theta * np.exp(0.05 * rng.standard_normal((count, len(fit.theta))))


def likelihood(count: int) -> Callable[[], Any]:
    fit, theta = loops("grasped", count)
    return lambda: fit.likelihood(theta)


def drawn(structure: str, count: int) -> tuple[bh.Model, np.ndarray]:
    """A model, and parameter vectors 20 % around the device file's."""
    model = getattr(bh, structure)(device="lhifam")
    rng = np.random.default_rng(0)
    return model, model.values * np.exp(0.2 * rng.standard_normal((count, model.size)))


def limit(structure: str) -> Callable[[], Any]:
    model, theta = drawn(structure, DRAWS)
    return lambda: bh.critical_stiffness(model, theta)


def starts() -> tuple[bh.Fit, np.ndarray]:
    """A fit, and 40 starting points within a factor e of the device file's values."""
    fit = fitted("grasped")
    rng = np.random.default_rng(1)
    return fit, fit.model.values * np.exp(rng.uniform(-1, 1, (STARTS, fit.model.size)))


def fit() -> Callable[[], Any]:
    known, start = starts()
    refine = moved("inference.least_squares").refine
    return lambda: refine(known.model, known.windows, start)


@lru_cache(maxsize=2)
def recording(seconds: float) -> bh.Recording:
    bench = Bench.from_device("lhifam", held=True)
    made = simulate(bench, WhiteNoise(bench.force_rms, bench.band_hz[1], seconds=seconds), seed=1)
    return bh.Recording(made.force, made.position, made.period_s)


def etfe(seconds: float) -> Callable[[], Any]:
    made = recording(seconds)
    return lambda: bh.estimate_etfe(made)


# Law: its module, class, place, the law's own shape and its strength.
LAWS: dict[str, tuple[str, str, str, dict[str, float], float]] = {
    "coulomb": ("friction", "CoulombFriction", "MOTOR", {}, 0.3),
    "stribeck": (
        "friction",
        "StribeckFriction",
        "MOTOR",
        {"static_excess": 0.8, "stribeck_velocity": 0.01},
        0.3,
    ),
    "dahl": ("friction", "DahlFriction", "MOTOR", {"presliding_distance": 1e-5}, 0.3),
    "drag": ("drag", "Drag", "MOTOR", {}, 10.0),
    "hardening": ("springs", "HardeningSpring", "MOTOR", {}, 1e9),
    "gap": ("springs", "Backlash", "CONNECTION", {"damping_in_gap": 0.9}, 1e-5),
}


def internal_force(name: str) -> Callable[[], Any]:
    """The motion under a law of one parameter vector, 30 s."""
    room, kind, at, shape, strength = LAWS[name]
    force = moved("effects.nonlinear.internal_force", "effects.internal_force")
    place = getattr(force, at)
    older = {"drag": "friction"}.get(room, room)
    known = moved(f"effects.nonlinear.{room}", f"effects.{older}")
    effect = getattr(known, kind)(place, shape) if shape else getattr(known, kind)(place)
    model, made = bh.free(device="lhifam"), recording(30.0)
    system = model.system(model.values)
    linear_motion = moved("models.response.motion", "models.motion").linear_motion
    motion = linear_motion(system, made.force, made.period_s, 0, SUBSTEPS)
    law = effect.law(strength, model, model.values)
    step = made.period_s / SUBSTEPS
    if hasattr(force, "Internal"):
        acting = [force.Internal(place, law, *motion)]
        return lambda: force.forced_motion(system.mechanism, acting, step, SUBSTEPS)
    return lambda: force.forced_motion(system.mechanism, place, law, *motion, step, SUBSTEPS)


def simulation() -> Callable[[], Any]:
    bench = Bench.from_device("lhifam", held=True).with_effect("coulomb_friction")
    return lambda: simulate(bench, seed=1)


JOBS: dict[str, Callable[[], Callable[[], Any]]] = {
    "likelihood 1": lambda: likelihood(1),
    "likelihood 64": lambda: likelihood(64),
    "likelihood 256": lambda: likelihood(256),
    **{f"limit {structure}": lambda structure=structure: limit(structure) for structure in CASES},
    "fit": fit,
    "etfe 30 s": lambda: etfe(30.0),
    "etfe 3600 s": lambda: etfe(3600.0),
    **{f"internal force, {name}": lambda name=name: internal_force(name) for name in LAWS},
    "simulate with friction": simulation,
}
