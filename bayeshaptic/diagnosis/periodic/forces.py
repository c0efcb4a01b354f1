"""Internal forces to try on a periodic recording: on the motor, on the body, in the connection."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from bayeshaptic.diagnosis.periodic.harmonic_balance import Basis
from bayeshaptic.diagnosis.periodic.steady_motion import LOAD, Floats
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, MOTOR, Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.models import Model
from bayeshaptic.models.parameter import unit_of

Force = Callable[[Motion], Floats]

_WHERE = {MOTOR: "at the motor", LOAD: "on the body", CONNECTION: "in the connection"}
_POWERS = (2, 3, 5)
_GAPS = (0.1, 0.3, 1.0)  # of the stretch's rms
_SHARP = 0.02  # of the velocity's rms: where sign(v) is rounded off


def force_candidates(model: Model, motions: Mapping[Place, Motion]) -> dict[str, tuple[Basis, ...]]:
    """Effect name to its variants, for the places that have a motion.

    Parameters
    ----------
    model : Model
    motions : mapping
        Place to the motion of one period.
    """
    found: dict[str, list[Basis]] = {}
    for place, motion in motions.items():
        if place not in _WHERE:
            continue
        for basis in _at(place, motion, model):
            found.setdefault(basis.name, []).append(basis)
    return {name: tuple(variants) for name, variants in found.items()}


def _at(place: Place, motion: Motion, model: Model) -> list[Basis]:
    force, x = model.force_unit, model.position_unit
    where = _WHERE[place]
    spring = [
        Basis(
            "hardening_spring",
            f"spring {where} that hardens or softens with the cube",
            place,
            lambda m: -(m.position**3),
            unit_of("cubic_stiffness", force, x),
        ),
        Basis(
            "hardening_spring",
            f"spring {where} that hardens or softens with the square",
            place,
            lambda m: -m.position * np.abs(m.position),
            f"{force}/{x}^2",
        ),
    ]
    drags = [
        Basis(
            "drag",
            f"drag {where} with power {power} of the velocity",
            place,
            _drag(power),
            f"{force} ({x}/s)^-{power}",
        )
        for power in _POWERS
    ]
    if place != CONNECTION:
        slow = _SHARP * float(np.sqrt(np.mean(motion.velocity**2)))
        friction = Basis(
            "coulomb_friction",
            f"dry (Coulomb) friction {where}",
            place,
            lambda m: -np.tanh(m.velocity / slow),
            force,
            positive=True,
        )
        return [friction, *drags, *spring]
    wide = float(np.sqrt(np.mean(motion.position**2)))
    gaps = [
        Basis(
            "backlash",
            f"gap of +-{gap * wide:.3g} {x} in the connection",
            place,
            _slack(gap * wide),
            unit_of("stiffness", force, x),
            positive=True,
        )
        for gap in _GAPS
    ]
    return [*drags, *spring, *gaps]


def _drag(power: int) -> Force:
    return lambda m: -m.velocity * np.abs(m.velocity) ** (power - 1)


def _slack(gap: float) -> Force:
    return lambda m: np.clip(m.position, -gap, gap)
