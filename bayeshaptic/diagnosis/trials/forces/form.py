"""Which numbers of forces are fitted: logarithms, whose ends and places go with them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.trials.forces.tryout import Point
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Form:
    """What of forces is fitted: the logarithms of the strength and the tuned shape of each."""

    forces: tuple[Acting, ...]
    begun: Floats
    """The logarithms where the fit begins, shape (J,)."""
    highest: Floats
    """The largest logarithms, shape (J,)."""
    shape: NDArray[np.bool_]
    """Which of them are of a shape."""
    grounded: NDArray[np.bool_]
    """Which of them are of a force that acts against the ground."""

    @classmethod
    def of(cls, found: Point) -> Form:
        bounds, shape, grounded = [], [], []
        for effect in (one.effect for one in found.forces):
            bounds += [np.inf, *(effect.most.get(name, np.inf) for name in effect.tuned)]
            shape += [False, *(True for _ in effect.tuned)]
            grounded += [effect.grounded] * (1 + len(effect.tuned))
        numbers = np.array(shape, bool), np.array(grounded, bool)
        return cls(found.forces, cls.logs(found), np.log(bounds), *numbers)

    @staticmethod
    def logs(found: Point) -> Floats:
        numbers = []
        for one in found.forces:
            numbers += [abs(one.strength), *(one.effect.shape[name] for name in one.effect.tuned)]
        return np.asarray(np.log(numbers))

    def at(self, logs: Floats) -> tuple[Acting, ...]:
        """The forces."""
        numbers = iter(np.exp(np.minimum(logs, self.highest)).tolist())
        found = []
        for one in self.forces:
            strength = float(np.sign(one.strength)) * next(numbers)
            tuned = {name: next(numbers) for name in one.effect.tuned}
            effect = replace(one.effect, shape={**one.effect.shape, **tuned})
            found.append(Acting(effect, strength))
        return tuple(found)
