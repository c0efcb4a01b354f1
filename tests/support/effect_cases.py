"""The linear effects of the library, each beside its twin on the virtual bench."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, ClassVar

import numpy as np
from on_the_bench import usual_noise

from bayeshaptic.effects.effect import LinearEffect
from bayeshaptic.effects.library import effect_class
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import Model, build_model
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.rig import Bench, Effect, register as on_the_bench, simulate
from bayeshaptic.rig.dynamics.structure import Relaxation, Structure


@dataclass(frozen=True)
class Case:
    """An effect on a device, and what the bench is told to have it.

    Attributes
    ----------
    id : str
    name : str
        Of the effect, in the library and on the bench.
    held : bool
    values : mapping
        Parameters of the effect in the library's terms.
    bench : mapping
        The same in the bench's terms.
    options : mapping
        Fields of the effect that tell its variant.
    response, limit : float
        Relative difference to the bench that is allowed in the response, and in K_CR.
    weak : tuple of str
        Parameters that a recording hardly tells, here.
    twin : str
        Name on the bench, where it differs.
    """

    id: str
    name: str
    held: bool
    values: Mapping[str, float]
    bench: Mapping[str, Any]
    options: Mapping[str, Any] = field(default_factory=dict)
    response: float = 1e-9
    limit: float = 1e-8
    weak: tuple[str, ...] = ()
    twin: str = ""
    device: str = "lhifam"

    @property
    def truth(self) -> Bench:
        return plain_bench(self.device, self.held).with_effect(self.twin or self.name, **self.bench)

    @property
    def base(self) -> Model:
        return build_model("grasped" if self.held else "free", self.device)

    @property
    def effect(self) -> LinearEffect:
        """The library's candidate of this variant."""
        found = [
            candidate
            for candidate in effect_class(self.name).candidates(self.base, recorded(self))
            if all(getattr(candidate, key) == value for key, value in self.options.items())
        ]
        assert len(found) == 1
        return found[0]

    def theta(self, model: Model) -> np.ndarray:
        """The true parameters of `model`, which has the effect."""
        every = {**self.base.reference, **self.values}
        return np.array([every[name] for name in model.names])


@on_the_bench
@dataclass(frozen=True)
class RelaxingTransmission(Effect):
    """A Maxwell element beside the transmission."""

    name: ClassVar[str] = "relaxing_transmission"
    stiffness: float = 1.0
    time_constant_s: float = 1.0

    def build(self, structure: Structure) -> None:
        element = Relaxation("m1", "m2", self.stiffness, self.time_constant_s)
        structure.relaxations.append(element)


def plain_bench(device: str, held: bool) -> Bench:
    return Bench.from_device(device, held=held)


@cache
def _recorded(case_id: str) -> Etfe:
    case = next(case for case in CASES if case.id == case_id)
    bench = case.truth
    excitation = usual_noise(bench, 12.0)
    run = simulate(bench, excitation, seed=11)
    return estimate_etfe(recording_from_arrays(**run.signals))


def recorded(case: Case) -> Etfe:
    """12 s of white noise on the bench with the effect."""
    return _recorded(case.id)


@cache
def _base_fit(case_id: str) -> Fit:
    case = next(case for case in CASES if case.id == case_id)
    return least_squares(case.base, recorded(case))


def base_fit(case: Case) -> Fit:
    """The fit of the device as declared, without the effect."""
    return _base_fit(case.id)


# A reflex on the bench is joined by straight lines over 1/8 ms.  Its structural damping is a sum of
# Maxwell elements, a constant loss modulus as far as they go: from a constant loss factor it is off
# by the square of that, over the damping at an antiresonance.
CASES = (
    Case(
        "mode on the motor",
        "second_mode",
        True,
        {"mode_hz": 110.0, "mode_mass": 0.03, "mode_damping": 0.02},
        {"frequency_hz": 110.0, "mass_ratio": 0.15, "damping_ratio": 0.02},
        {"on": "m1"},
    ),
    Case(
        "mode on the body",
        "second_mode",
        False,
        {"mode_hz": 45.0, "mode_mass": 0.52, "mode_damping": 0.03},
        {"frequency_hz": 45.0, "mass_ratio": 0.1, "damping_ratio": 0.03, "on": "m2"},
        {"on": "m2"},
    ),
    Case(
        "mode of the arm",
        "arm_mode",
        True,
        {"arm_hz": 12.0, "arm_mass": 0.71, "arm_damping": 0.2},
        {"frequency_hz": 12.0, "mass_ratio": 0.5, "damping_ratio": 0.2, "on": "hand"},
        twin="second_mode",
    ),
    Case("delay", "extra_delay", True, {"extra_delay_s": 1.35e-3}, {"delay_s": 1.35e-3}),
    Case(
        "lag",
        "actuator_lag",
        True,
        {"lag_s": 4e-4},
        {"time_constant_s": 4e-4},
        {"order": 1},
    ),
    Case(
        "lag of order 3",
        "actuator_lag",
        False,
        {"lag_s": 2e-4},
        {"time_constant_s": 2e-4, "order": 3},
        {"order": 3},
        response=2e-7,
        limit=2e-7,
    ),
    Case(
        "filter", "position_filter", False, {"filter_hz": 150.0}, {"cutoff_hz": 150.0}, {"order": 1}
    ),
    Case(
        "filter of order 2",
        "position_filter",
        True,
        {"filter_hz": 180.0, "filter_damping": 0.6},
        {"cutoff_hz": 180.0, "order": 2, "damping_ratio": 0.6},
        {"order": 2},
    ),
    Case(
        "centring",
        "centring_stiffness",
        False,
        {"centring_stiffness": 300.0},
        {"stiffness": 300.0},
    ),
    Case(
        "base",
        "base_compliance",
        True,
        {"base_hz": 25.0, "base_mass": 3.98 * 4, "base_damping": 0.05},
        {"frequency_hz": 25.0, "mass_ratio": 4.0, "damping_ratio": 0.05},
    ),
    Case(
        "reflex",
        "reflex",
        True,
        {
            "reflex_stiffness": 70.0,
            "reflex_damping": 9.0,
            "reflex_delay_s": 0.0305,
            "reflex_lag_s": 0.01,
        },
        {"stiffness": 70.0, "damping": 9.0, "delay_s": 0.0305, "time_constant_s": 0.01},
        response=2e-5,
        limit=2e-5,
        weak=("reflex_stiffness", "reflex_damping", "reflex_lag_s"),
    ),
    Case(
        "constant loss factor",
        "structural_damping",
        False,
        {"loss_factor": 0.08},
        {"loss_factor": 0.08, "decades": 6.0, "elements": 25},
        {"constant": "factor"},
        response=0.08,
        limit=5e-3,
        weak=("loss_factor",),
    ),
    Case(
        "constant loss modulus",
        "structural_damping",
        True,
        {"loss_factor": 0.12},
        {"loss_factor": 0.12, "decades": 3.9, "elements": 41},  # each for a tenth of four decades
        {"constant": "modulus"},
        response=5e-5,
        limit=1e-6,
    ),
    Case(
        "relaxing transmission",
        "relaxing_transmission",
        True,
        {"relaxing_stiffness": 2e4, "relaxation_s": 4e-3},
        {"stiffness": 2e4, "time_constant_s": 4e-3},
        response=1e-7,
        limit=1e-6,
    ),
)
