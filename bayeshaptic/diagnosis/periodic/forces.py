"""Internal forces to try on a periodic recording: on the motor, on the body, in the connection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bayeshaptic.diagnosis.periodic.joint import Basis
from bayeshaptic.effects.laws import fitted
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR, Place
from bayeshaptic.effects.nonlinear.protocol import Motion
from bayeshaptic.effects.nonlinear.shapes import VELOCITY, Shape, Usual
from bayeshaptic.models import Model
from bayeshaptic.types import Floats

_WHERE = {MOTOR: "at the motor", LOAD: "on the body", CONNECTION: "in the connection"}
_SHARP = 0.02  # of the variable's rms: where a jump is rounded off


@dataclass(frozen=True)
class _Force:
    """A law's shape as a force of a motion; harmonics need a jump to be rounded off.

    It is kept by its names: a shape holds functions, which no worker process can hand back.
    """

    effect: str
    shape: str
    place: Place
    usual: Usual

    def __call__(self, motion: Motion) -> Floats:
        shape, usual = _shapes(self.place, self.usual)[self.effect, self.shape], self.usual
        variable = motion.velocity if shape.over == VELOCITY else motion.position
        unit = usual.velocity if shape.over == VELOCITY else usual.position
        smooth = np.tanh(np.abs(variable) / (_SHARP * unit)) if shape.jumps else 1.0
        return np.asarray(shape.force(variable) * smooth)


@lru_cache(maxsize=64)
def _shapes(place: Place, usual: Usual) -> dict[tuple[str, str], Shape]:
    return {(name, shape.name): shape for name, shape in fitted(place, usual)}


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
        usual = Usual.of(motion.velocity, motion.position, model.position_unit)
        for name, shape in fitted(place, usual):
            basis = Basis(
                name,
                shape.title.format(where=_WHERE[place]),
                place,
                _Force(name, shape.name, place, usual),
                shape.unit(model.force_unit, model.position_unit),
                shape.positive,
            )
            found.setdefault(name, []).append(basis)
    return {name: tuple(variants) for name, variants in found.items()}
